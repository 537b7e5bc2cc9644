//! MATLAB files of version 7.3: HDF5 behind 512 bytes of MATLAB's own, a dataset per array and a group per structure.
//!
//! An array of m x n stands as a dataset of n x m, which is MATLAB's own order of columns. `MATLAB_class` names what it is; a file of another
//! program that lacks it is taken by the type of its numbers. A cell array is a dataset of object references to its elements, which lie in the group
//! `#refs#`; of an array of structures every field is such a dataset.

use super::array::{Array, Body, DEPTH, Numbers};
use super::{CELL, bomb, broken, limit};
use crate::data::DataError;
use hdf5_reader::error::Error;
use hdf5_reader::group::Group;
use hdf5_reader::messages::datatype::ReferenceType;
use hdf5_reader::reference::read_object_references;
use hdf5_reader::{Dataset, Datatype, Hdf5File, OpenOptions};
use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;

const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";
/// Bytes of an object's header at most.
const HEADER: usize = 1 << 20;
/// Fields of structures and elements of cells that are followed: a group may hold itself, a cell may refer to itself, and many times over.
const FIELDS: usize = 1 << 16;

/// Whether the bytes are HDF5, alone or behind MATLAB's header.
pub(super) fn is(bytes: &[u8]) -> bool {
    bytes.starts_with(b"MATLAB 7.3") || bytes.starts_with(SIGNATURE) || bytes.get(512..520) == Some(SIGNATURE)
}

/// Calls `each` with every variable of the file; the numbers of those that are not `wanted` stay unread.
pub(super) fn variables(
    path: &Path,
    bytes: &[u8],
    wanted: impl Fn(&str) -> bool,
    mut each: impl FnMut(&Array<'_>) -> Result<(), DataError>,
) -> Result<(), DataError> {
    let most = limit(bytes);
    let fail = |e: Error| match e {
        Error::ResourceLimit { .. } => bomb(path, most),
        e => broken(path, format!("a damaged MATLAB file of version 7.3 (HDF5): {e}"), "a whole file; save it again"),
    };
    let options = OpenOptions {
        chunk_cache_bytes: 0,
        max_chunk_bytes: most,
        max_read_bytes: most,
        max_object_header_bytes: HEADER,
        ..Default::default()
    };
    let root = Hdf5File::from_bytes_with_options(bytes, options).and_then(|f| f.root_group()).map_err(fail)?;
    let (groups, datasets) = root.members().map_err(fail)?;
    let mut file =
        File { targets: Targets::of(&groups, &datasets).map_err(fail)?, offset_size: root.offset_size(), left: FIELDS, bytes: most };
    let mut none = true;
    for dataset in &datasets {
        none = false;
        each(&file.array(dataset, wanted(name_of(dataset)), 0).map_err(fail)?)?;
    }
    for group in groups.iter().filter(|g| !own(g)) {
        none = false;
        each(&file.structure(group, wanted(group.name()), 0).map_err(fail)?)?;
    }
    if none { Err(broken(path, "a MATLAB file of version 7.3 (HDF5) without variables", "a file with variables")) } else { Ok(()) }
}

/// What begins with # is MATLAB's own: the elements of cells that references point to, and its objects.
fn own(group: &Group) -> bool {
    group.name().starts_with('#')
}

/// What a reference may point to, by its address: the variables, and the members of `#refs#`, where MATLAB puts the elements of cells.
struct Targets {
    groups: HashMap<u64, Group>,
    datasets: HashMap<u64, Dataset>,
}

impl Targets {
    fn of(groups: &[Group], datasets: &[Dataset]) -> Result<Targets, Error> {
        let mut all = Targets { groups: HashMap::new(), datasets: HashMap::new() };
        all.add(groups.iter().filter(|g| !own(g)).cloned(), datasets.iter().cloned());
        for group in groups.iter().filter(|g| g.name() == "#refs#") {
            let (groups, datasets) = group.members()?;
            all.add(groups.into_iter(), datasets.into_iter());
        }
        Ok(all)
    }

    fn add(&mut self, groups: impl Iterator<Item = Group>, datasets: impl Iterator<Item = Dataset>) {
        self.groups.extend(groups.map(|g| (g.address(), g)));
        self.datasets.extend(datasets.map(|d| (d.address(), d)));
    }
}

/// A file while it is read.
struct File {
    targets: Targets,
    /// Bytes of an address.
    offset_size: u8,
    /// Fields and elements that may still be followed.
    left: usize,
    /// Bytes of numbers that may still be read: many references may point to the same ones.
    bytes: usize,
}

impl File {
    /// A structure, or an array of structures: there every field is a dataset of references without a class of its own, one for each element.
    fn structure(&mut self, group: &Group, numbers: bool, depth: usize) -> Result<Array<'static>, Error> {
        let named = |dims, body| Array { name: group.name().to_string(), class: STRUCT, dims, body };
        if depth >= DEPTH {
            return Ok(named(vec![1, 1], Body::Other));
        }
        let (groups, datasets) = group.members()?;
        self.follow(groups.len() + datasets.len())?;
        let many = |d: &Dataset| is_reference(d) && class_of(d).is_none();
        if groups.is_empty() && !datasets.is_empty() && datasets.iter().all(many) {
            let dims = dims_of(&datasets[0]);
            let mut elements: Vec<Vec<(String, Array)>> = Vec::new();
            for dataset in &datasets {
                let field = self.elements(dataset, numbers, depth)?;
                elements.resize_with(elements.len().max(field.len()), Vec::new);
                elements.iter_mut().zip(field).for_each(|(element, value)| element.push((name_of(dataset).to_string(), value)));
            }
            let one = |fields| Array { name: String::new(), class: STRUCT, dims: vec![1, 1], body: Body::Struct(fields) };
            return Ok(named(dims, Body::Elements(elements.into_iter().map(one).collect())));
        }
        let mut fields = Vec::with_capacity(groups.len() + datasets.len());
        for dataset in &datasets {
            let a = self.array(dataset, numbers, depth + 1)?;
            fields.push((a.name.clone(), a));
        }
        for inner in &groups {
            fields.push((inner.name().to_string(), self.structure(inner, numbers, depth + 1)?));
        }
        Ok(named(vec![1, 1], Body::Struct(fields)))
    }

    /// What the references in a dataset point to, in MATLAB's order. A reference that points to nothing known (an object, a deleted element) is no array of numbers.
    fn elements(&mut self, dataset: &Dataset, numbers: bool, depth: usize) -> Result<Vec<Array<'static>>, Error> {
        let addresses = read_object_references(&self.read(|| dataset.read_raw_bytes())?, self.offset_size)?;
        self.follow(addresses.len())?;
        let mut elements = Vec::with_capacity(addresses.len());
        for address in addresses {
            elements.push(if let Some(target) = self.targets.datasets.get(&address).cloned() {
                self.array(&target, numbers, depth + 1)?
            } else if let Some(target) = self.targets.groups.get(&address).cloned() {
                self.structure(&target, numbers, depth + 1)?
            } else {
                Array { name: String::new(), class: OBJECT, dims: vec![1, 1], body: Body::Other }
            });
        }
        Ok(elements)
    }

    /// Counts fields or elements that are followed.
    fn follow(&mut self, count: usize) -> Result<(), Error> {
        let many = || Error::InvalidData(format!("structures and cells of more than {FIELDS} fields and elements"));
        self.left = self.left.checked_sub(count).ok_or_else(many)?;
        Ok(())
    }

    /// Counts bytes that are read.
    fn read(&mut self, bytes: impl FnOnce() -> Result<Vec<u8>, Error>) -> Result<Vec<u8>, Error> {
        let bytes = bytes()?;
        let many = || Error::InvalidData("cells that refer to the same numbers again and again".into());
        self.bytes = self.bytes.checked_sub(bytes.len()).ok_or_else(many)?;
        Ok(bytes)
    }

    fn array(&mut self, dataset: &Dataset, numbers: bool, depth: usize) -> Result<Array<'static>, Error> {
        let dims = dims_of(dataset);
        let name = name_of(dataset).to_string();
        let kind = kind(dataset.dtype());
        let parts = parts(dataset.dtype());
        // An empty array stands as its dimensions.
        let empty = dataset.attribute("MATLAB_empty").ok().and_then(|a| a.read_as_f64().ok()).is_some_and(|n| n != 0.0);
        let class = match class_of(dataset).as_deref() {
            Some("cell") => CELL,
            Some("struct") => STRUCT,
            Some("char") => 4,
            Some("double" | "single" | "logical" | "int8" | "uint8" | "int16" | "uint16" | "int32" | "uint32" | "int64" | "uint64") => 6,
            None if kind.is_some() || parts.is_some() => 6,
            None if is_reference(dataset) => CELL,
            _ => OBJECT,
        };
        let body = match kind {
            _ if empty => Body::Other,
            _ if class == CELL && is_reference(dataset) && depth < DEPTH => Body::Elements(self.elements(dataset, numbers, depth)?),
            Some(kind) if class == 6 => {
                let bytes = if numbers { Cow::Owned(self.read(|| dataset.read_native_bytes())?) } else { Cow::Borrowed(&[][..]) };
                Body::Numeric { re: Numbers { kind, bytes, big: BIG_ENDIAN }, im: None }
            }
            _ if class == 6 => match parts {
                Some((width, both)) => {
                    let all = if numbers { self.read(|| dataset.read_native_bytes())? } else { vec![] };
                    let [re, im] = both.map(|(kind, from)| {
                        let one = all.chunks_exact(width).filter_map(|e| e.get(from..from + Numbers::width_of(kind)));
                        Numbers { kind, bytes: Cow::Owned(one.flatten().copied().collect()), big: BIG_ENDIAN }
                    });
                    Body::Numeric { re, im: Some(im) }
                }
                None => Body::Other,
            },
            _ => Body::Other,
        };
        Ok(Array { name, class, dims, body })
    }
}

/// Classes of arrays, as version 5 numbers them.
const STRUCT: u8 = 2;
const OBJECT: u8 = 3;

fn name_of(dataset: &Dataset) -> &str {
    dataset.name().trim_start_matches('/')
}

/// Rows, columns and further dimensions: HDF5 has them in the opposite order.
fn dims_of(dataset: &Dataset) -> Vec<usize> {
    let mut dims: Vec<usize> = dataset.shape().iter().rev().map(|n| usize::try_from(*n).unwrap_or(usize::MAX)).collect();
    dims.resize(dims.len().max(2), 1);
    dims
}

/// What MATLAB says the dataset is; none of the fields of an array of structures.
fn class_of(dataset: &Dataset) -> Option<String> {
    let text = dataset.attribute("MATLAB_class").ok().and_then(|a| a.read_string().ok())?;
    Some(text.trim_end_matches('\0').to_string())
}

fn is_reference(dataset: &Dataset) -> bool {
    matches!(dataset.dtype(), Datatype::Reference { ref_type: ReferenceType::Object, .. })
}

/// Whether this machine, in whose order numbers are read, keeps their highest byte first.
const BIG_ENDIAN: bool = cfg!(target_endian = "big");

/// Of complex numbers the bytes of one, and type and place of its real and imaginary part.
fn parts(of: &Datatype) -> Option<(usize, [(u32, usize); 2])> {
    let Datatype::Compound { size, fields } = of else { return None };
    let part = |name: &str| {
        let field = fields.iter().find(|f| f.name == name)?;
        Some((kind(&field.datatype)?, usize::try_from(field.byte_offset).ok()?))
    };
    Some((usize::try_from(*size).ok().filter(|s| *s > 0)?, [part("real")?, part("imag")?]))
}

/// The type of data element of the same numbers in a file of version 5.
fn kind(of: &Datatype) -> Option<u32> {
    match of {
        Datatype::FloatingPoint { size: 4, .. } => Some(7),
        Datatype::FloatingPoint { size: 8, .. } => Some(9),
        Datatype::FixedPoint { size, signed, .. } => {
            let unsigned = u32::from(!signed);
            match size {
                1 => Some(1 + unsigned),
                2 => Some(3 + unsigned),
                4 => Some(5 + unsigned),
                8 => Some(12 + unsigned),
                _ => None,
            }
        }
        _ => None,
    }
}
