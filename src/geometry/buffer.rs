//! Arrays that belong to somebody else: typed, checked views of shared bytes.

use std::fmt;
use std::marker::PhantomData;
use std::ops::Deref;

use bytemuck::Pod;
use bytes::Bytes;

/// An immutable array of `T` in memory that may belong to Python, to a mapped file or to us; clones share it.
///
/// Alignment and length are checked when it is made, so that reading it never copies and never fails.
pub struct Buffer<T> {
    bytes: Bytes,
    element: PhantomData<T>,
}

impl<T: Pod> Buffer<T> {
    /// A view of `bytes` as elements of type `T`; the error says what does not fit.
    pub fn new(bytes: Bytes) -> Result<Self, String> {
        if std::mem::size_of::<T>() == 0 {
            return Err("elements without size cannot be viewed".to_owned());
        }
        // An empty array may begin anywhere.
        if bytes.is_empty() {
            return Ok(Self { bytes, element: PhantomData });
        }
        match bytemuck::try_cast_slice::<u8, T>(&bytes) {
            Ok(_) => Ok(Self { bytes, element: PhantomData }),
            Err(bytemuck::PodCastError::TargetAlignmentGreaterAndInputNotAligned) => Err(format!(
                "the array does not begin at a multiple of {} bytes; copy it to aligned memory",
                std::mem::align_of::<T>()
            )),
            Err(_) => Err(format!(
                "{} bytes are not a whole number of elements of {} bytes",
                bytes.len(),
                std::mem::size_of::<T>()
            )),
        }
    }

    /// Takes over a vector without copying it.
    pub fn from_vec(elements: Vec<T>) -> Self
    where
        T: Send + Sync,
    {
        Self { bytes: Bytes::from_owner(Owned(elements)), element: PhantomData }
    }

    /// The same memory as elements of another type; the error says what does not fit.
    pub fn cast<U: Pod>(&self) -> Result<Buffer<U>, String> {
        Buffer::new(self.bytes.clone())
    }

    /// The elements.
    pub fn as_slice(&self) -> &[T] {
        if self.bytes.is_empty() { &[] } else { bytemuck::cast_slice(&self.bytes) }
    }
}

/// Lets `Bytes` own a vector of any plain type, and keep its alignment.
struct Owned<T>(Vec<T>);

impl<T: Pod> AsRef<[u8]> for Owned<T> {
    fn as_ref(&self) -> &[u8] {
        bytemuck::cast_slice(&self.0)
    }
}

impl<T: Pod> Deref for Buffer<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        self.as_slice()
    }
}

impl<T> Clone for Buffer<T> {
    fn clone(&self) -> Self {
        Self { bytes: self.bytes.clone(), element: PhantomData }
    }
}

impl<T> fmt::Debug for Buffer<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Buffer<{}>({} bytes)", std::any::type_name::<T>(), self.bytes.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_buffer_shares_memory_and_refuses_what_does_not_fit() {
        let owned = Buffer::from_vec(vec![1.0_f32, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let points = Buffer::<[f32; 3]>::new(owned.bytes.clone()).expect("two points");
        assert_eq!(points.as_slice(), &[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        assert_eq!(points.as_ptr().cast::<f32>(), owned.as_ptr());
        assert!(Buffer::<[f32; 3]>::new(owned.bytes.slice(0..16)).is_err());
        assert!(Buffer::<f32>::new(owned.bytes.slice(1..5)).expect_err("misaligned").contains("multiple of 4"));
        assert!(Buffer::<f32>::new(Bytes::new()).expect("empty").is_empty());
    }
}
