//! A subdivision surface as polygons on its limit surface, with everything that the control mesh carries.

use rayon::prelude::*;

use super::super::motion::Deformation;
use super::super::{Buffer, Interpolation, NamedPrimvar, PolygonMesh, PrimvarView};
use super::{Refiner, Surface};

/// Values over refined polygons.
struct Primvar {
    values: Buffer<f32>,
    indices: Option<Vec<i32>>,
    interpolation: Interpolation,
}

impl Primvar {
    fn new<const N: usize>(values: &[[f64; N]], indices: Option<Vec<i32>>, interpolation: Interpolation) -> Self {
        let values = Buffer::from_vec(values.iter().flatten().map(|&x| x as f32).collect());
        Self { values, indices, interpolation }
    }

    fn view(&self) -> PrimvarView<'_> {
        PrimvarView { values: self.values.clone(), indices: self.indices.as_deref(), interpolation: self.interpolation }
    }
}

/// What takes the place of a control mesh.
pub(in super::super) struct Refined {
    points: Buffer<[f32; 3]>,
    counts: Vec<i32>,
    indices: Buffer<i32>,
    holes: Vec<i32>,
    normals: Primvar,
    uv: Option<Primvar>,
    primvars: Vec<Option<Primvar>>,
    /// The authored face of each face; empty where nothing asks.
    parents: Vec<u32>,
}

impl Refined {
    /// Polygons and primvars are checked.
    pub(in super::super) fn new(refiner: &Refiner, polygons: &PolygonMesh<'_>) -> Self {
        let Surface { points, normals, normal_indices } = refiner.surface(&polygons.points);
        let uv = polygons.uv.as_ref().map(|uv| primvar::<2>(refiner, polygons, uv));
        let refine = |NamedPrimvar { columns, view, .. }: &NamedPrimvar<'_>| match columns {
            1 => primvar::<1>(refiner, polygons, view),
            2 => primvar::<2>(refiner, polygons, view),
            3 => primvar::<3>(refiner, polygons, view),
            _ => primvar::<4>(refiner, polygons, view),
        };
        let primvars = polygons.primvars.iter().map(|named| named.as_ref().map(refine)).collect();
        let corners = refiner.corner_points();
        let has_holes = refiner.holes.iter().any(|&hole| hole);
        let parents =
            if has_holes || !polygons.subsets.is_empty() { refiner.authored_faces().collect() } else { Vec::new() };
        let is_hidden = |&face: &usize| has_holes && refiner.is_hole(parents[face]);
        let faces = corners.len() / refiner.face_size();
        Self {
            points: Buffer::from_vec(points),
            counts: vec![refiner.face_size() as i32; faces],
            indices: Buffer::from_vec(corners.iter().map(|&i| i as i32).collect()),
            holes: (0..faces).filter(is_hidden).map(|face| face as i32).collect(),
            normals: Primvar {
                values: Buffer::from_vec(normals),
                interpolation: match normal_indices {
                    Some(_) => Interpolation::FaceVarying,
                    None => Interpolation::Vertex,
                },
                indices: normal_indices,
            },
            uv,
            primvars,
            parents,
        }
    }

    /// As polygons, without subsets.
    pub(in super::super) fn polygons<'a>(&'a self, control: &PolygonMesh<'a>) -> PolygonMesh<'a> {
        let named = |(named, refined): (&Option<NamedPrimvar<'a>>, &'a Option<Primvar>)| {
            Some(NamedPrimvar { view: refined.as_ref()?.view(), ..named.clone()? })
        };
        PolygonMesh {
            path: control.path,
            points: self.points.clone(),
            counts: &self.counts,
            indices: self.indices.clone(),
            holes: &self.holes,
            left_handed: control.left_handed,
            normals: Some(self.normals.view()),
            uv: self.uv.as_ref().map(Primvar::view),
            uv_number: control.uv_number,
            primvars: control.primvars.iter().zip(&self.primvars).map(named).collect(),
            subsets: &[],
            subdivision: None,
        }
    }

    /// What the authored faces have, for each face.
    pub(in super::super) fn of_faces<T: Copy>(&self, authored: &[T]) -> Vec<T> {
        self.parents.iter().map(|&face| authored[face as usize]).collect()
    }
}

impl Refiner {
    /// The limit surface of points that move.
    pub(in super::super) fn deformation(&self, control: &Deformation) -> Deformation {
        let surfaces = control.points.iter().map(|points| self.surface(points));
        let (points, normals) = surfaces.map(|s| (Buffer::from_vec(s.points), Buffer::from_vec(s.normals))).unzip();
        Deformation { times: control.times.clone(), points, normals: Some(normals) }
    }
}

fn primvar<const N: usize>(refiner: &Refiner, polygons: &PolygonMesh<'_>, primvar: &PrimvarView<'_>) -> Primvar {
    let index = |element: usize| primvar.indices.map_or(element, |indices| indices[element] as usize);
    let value = |i: usize| -> [f64; N] { std::array::from_fn(|k| primvar.values[i * N + k].into()) };
    match primvar.interpolation {
        Interpolation::Constant => Primvar {
            values: primvar.values.clone(),
            indices: primvar.indices.map(<[i32]>::to_vec),
            interpolation: Interpolation::Constant,
        },
        Interpolation::Uniform => Primvar {
            values: primvar.values.clone(),
            indices: Some(refiner.authored_faces().map(|face| index(face as usize) as i32).collect()),
            interpolation: Interpolation::Uniform,
        },
        interpolation @ (Interpolation::Varying | Interpolation::Vertex) => {
            let values = (0..polygons.points.len()).map(|point| value(index(point))).collect();
            Primvar::new(&refiner.values(values, interpolation), None, Interpolation::Vertex)
        }
        Interpolation::FaceVarying => {
            let values: Vec<[f64; N]> = (0..primvar.values.len() / N).map(value).collect();
            let refined = match primvar.indices {
                Some(indices) => refiner.face_varying(|corner| indices[corner] as u32, &values),
                None => {
                    let equal = equal_values(&values);
                    refiner.face_varying(|corner| equal[corner], &values)
                }
            };
            let interpolation =
                if refined.indices.is_some() { Interpolation::FaceVarying } else { Interpolation::Vertex };
            Primvar::new(&refined.values, refined.indices, interpolation)
        }
    }
}

/// For values without indices: the first of those that are equal. Faces whose corners at a point have equal values are
/// joined there, as if the values were indexed.
fn equal_values<const N: usize>(values: &[[f64; N]]) -> Vec<u32> {
    // Adding 0 turns −0 into 0.
    let key = |i: u32| values[i as usize].map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..values.len() as u32).collect();
    order.par_sort_unstable_by_key(|&i| (key(i), i));
    let mut first = vec![0; values.len()];
    for group in order.chunk_by(|&a, &b| key(a) == key(b)) {
        group.iter().for_each(|&i| first[i as usize] = group[0]);
    }
    first
}
