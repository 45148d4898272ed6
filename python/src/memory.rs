//! Memory shared with NumPy in both directions: the one file with `unsafe`.
//!
//! *Python to Rust*: a read-only array crosses as [`Bytes`] that keep the Python object alive; nothing is copied. Writable
//! input is copied before anything else happens, since another thread could write to it once the interpreter is released.
//! *Rust to Python*: a film's layer crosses as a read-only array whose base is the film.
//!
//! Both need `unsafe` because lifetimes end at the border: only reference counts tie a pointer to its owner. The tests stand
//! in `tests/python/test_api.py` (`test_read_only_arrays_are_shared`, `test_film_layers_are_views`): what is shared
//! is shared, what is writable is copied, and the memory outlives the last Python name for it.
#![allow(unsafe_code, reason = "pointers into NumPy's memory, kept valid by reference counts; see each block")]

use abbe::scene::description::{Array, Element};
use bytemuck::NoUninit;
use bytes::Bytes;
use numpy::ndarray::ArrayView3;
use numpy::{
    Element as NumpyElement, PyArray3, PyArrayDescrMethods, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

/// A NumPy array's elements, valid as long as this is.
struct NumpyMemory {
    /// Keeps the elements alive: NumPy frees them with the last reference to the array.
    _array: Py<PyUntypedArray>,
    first: *const u8,
    length: usize,
}

// SAFETY: `first` points to plain numbers that nobody writes (`is_frozen`), so any thread may read them; the reference to the
// Python object is only dropped, which pyo3 does with the interpreter held or later.
unsafe impl Send for NumpyMemory {}
// SAFETY: as above; shared access only reads.
unsafe impl Sync for NumpyMemory {}

impl AsRef<[u8]> for NumpyMemory {
    fn as_ref(&self) -> &[u8] {
        // SAFETY: `first` and `length` come from a slice over a C-contiguous array that `_array` keeps alive, and nobody writes.
        unsafe { std::slice::from_raw_parts(self.first, self.length) }
    }
}

/// Whether nobody can write to `array`'s elements through it or an array that it is a view of.
///
/// USD's arrays come as read-only views of a buffer that USD copies before it writes. Python code can still lift the flag of an
/// array on purpose; the elements are plain numbers that are checked again where they are used as indices, so that this
/// spoils pictures and nothing else.
fn is_frozen(array: &Bound<'_, PyUntypedArray>) -> PyResult<bool> {
    let mut current = array.clone();
    loop {
        if current.getattr("flags")?.getattr("writeable")?.extract::<bool>()? {
            return Ok(false);
        }
        match current.getattr("base")?.cast_into::<PyUntypedArray>() {
            Ok(base) => current = base,
            Err(_) => return Ok(true),
        }
    }
}

fn bytes_of<T: NumpyElement + NoUninit>(array: &Bound<'_, PyUntypedArray>) -> PyResult<Bytes> {
    let typed: PyReadonlyArrayDyn<'_, T> = array.extract()?;
    let Ok(elements) = typed.as_slice() else {
        // Strided or misaligned: NumPy copies it into order, and the copy is ours.
        let ordered = array.py().import("numpy")?.call_method1("require", (array, array.dtype(), ("C", "A", "E")))?;
        ordered.getattr("flags")?.setattr("writeable", false)?;
        return bytes_of::<T>(ordered.cast::<PyUntypedArray>()?);
    };
    let bytes: &[u8] = bytemuck::cast_slice(elements);
    if is_frozen(array)? {
        let owner = NumpyMemory { _array: array.clone().unbind(), first: bytes.as_ptr(), length: bytes.len() };
        Ok(Bytes::from_owner(owner))
    } else {
        Ok(Bytes::copy_from_slice(bytes))
    }
}

/// `array` as the core takes it: shared if it is read-only, copied if it could change.
///
/// The element type must be float32, float64, int32 or uint8 in native byte order; `name` stands in the error.
pub(crate) fn array_from_numpy(name: &str, array: &Bound<'_, PyUntypedArray>) -> PyResult<Array> {
    let dtype = array.dtype();
    let is = |other: Bound<'_, numpy::PyArrayDescr>| dtype.is_equiv_to(&other);
    let py = array.py();
    let (element, bytes) = if is(numpy::dtype::<f32>(py)) {
        (Element::F32, bytes_of::<f32>(array)?)
    } else if is(numpy::dtype::<i32>(py)) {
        (Element::I32, bytes_of::<i32>(array)?)
    } else if is(numpy::dtype::<f64>(py)) {
        (Element::F64, bytes_of::<f64>(array)?)
    } else if is(numpy::dtype::<u8>(py)) {
        (Element::U8, bytes_of::<u8>(array)?)
    } else {
        return Err(PyTypeError::new_err(format!(
            "array '{name}' is {dtype}: pass float32, float64, int32 or uint8 in native byte order"
        )));
    };
    Ok(Array { element, shape: array.shape().to_vec(), bytes })
}

/// A read-only view of `values`, which belong to `owner`, as `height × width × channels`.
///
/// `owner` must be a frozen class that never changes or moves `values`: it is kept alive by the view.
pub(crate) fn view_of<'py, T: NumpyElement>(
    owner: Bound<'py, PyAny>,
    shape: [usize; 3],
    values: &[T],
) -> Bound<'py, PyArray3<T>> {
    let view = ArrayView3::from_shape(shape, values).expect("a layer has height × width × channels values");
    // SAFETY: `values` is the heap memory of a `Vec` inside `owner`, which is frozen, so it stays where it is until `owner` is
    // dropped; the array holds a reference to `owner`.
    let array = unsafe { PyArray3::borrow_from_array(&view, owner) };
    array.readwrite().make_nonwriteable();
    array
}
