//! MATLAB files of version 7.3: HDF5 behind 512 bytes of MATLAB's own, a dataset per array and a group per structure.
//!
//! An array of m x n stands as a dataset of n x m, which is MATLAB's own order of columns. `MATLAB_class` names what it is; a file of another
//! program that lacks it is taken by the type of its numbers.

use super::array::{Array, Body, DEPTH, Numbers};
use super::{bomb, broken, limit};
use crate::data::DataError;
use hdf5_reader::error::Error;
use hdf5_reader::group::Group;
use hdf5_reader::{Dataset, Datatype, Hdf5File, OpenOptions};
use std::borrow::Cow;
use std::path::Path;

const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";
/// Bytes of an object's header at most.
const HEADER: usize = 1 << 20;
/// Fields of structures that are followed: a group may hold itself, and many times over.
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
    let (mut none, mut left) = (true, FIELDS);
    for dataset in &datasets {
        none = false;
        each(&array(dataset, wanted(name_of(dataset))).map_err(fail)?)?;
    }
    // What begins with # is MATLAB's own: the cells that references point to.
    for group in groups.iter().filter(|g| !g.name().starts_with('#')) {
        none = false;
        each(&structure(group, wanted(group.name()), 0, &mut left).map_err(fail)?)?;
    }
    if none { Err(broken(path, "a MATLAB file of version 7.3 (HDF5) without variables", "a file with variables")) } else { Ok(()) }
}

fn structure(group: &Group, numbers: bool, depth: usize, left: &mut usize) -> Result<Array<'static>, Error> {
    let body = if depth < DEPTH {
        let (groups, datasets) = group.members()?;
        let count = groups.len() + datasets.len();
        *left = left.checked_sub(count).ok_or_else(|| Error::InvalidData(format!("structures of more than {FIELDS} fields")))?;
        let mut fields = Vec::with_capacity(count);
        for dataset in &datasets {
            let a = array(dataset, numbers)?;
            fields.push((a.name.clone(), a));
        }
        for inner in &groups {
            fields.push((inner.name().to_string(), structure(inner, numbers, depth + 1, left)?));
        }
        Body::Struct(fields)
    } else {
        Body::Other
    };
    Ok(Array { name: group.name().to_string(), class: 2, dims: vec![1, 1], body })
}

fn name_of(dataset: &Dataset) -> &str {
    dataset.name().trim_start_matches('/')
}

fn array(dataset: &Dataset, numbers: bool) -> Result<Array<'static>, Error> {
    let shape = dataset.shape();
    let mut dims: Vec<usize> = shape.iter().rev().map(|n| usize::try_from(*n).unwrap_or(usize::MAX)).collect();
    dims.resize(dims.len().max(2), 1);
    let name = name_of(dataset).to_string();
    let class = dataset.attribute("MATLAB_class").ok().and_then(|a| a.read_string().ok());
    let kind = kind(dataset.dtype());
    let parts = parts(dataset.dtype());
    // An empty array stands as its dimensions.
    let empty = dataset.attribute("MATLAB_empty").ok().and_then(|a| a.read_as_f64().ok()).is_some_and(|n| n != 0.0);
    let class = match class.as_deref().map(|c| c.trim_end_matches('\0')) {
        Some("cell") => 1,
        Some("struct") => 2,
        Some("char") => 4,
        Some("double" | "single" | "logical" | "int8" | "uint8" | "int16" | "uint16" | "int32" | "uint32" | "int64" | "uint64") => 6,
        None if kind.is_some() || parts.is_some() => 6,
        _ => 3,
    };
    let body = match kind {
        Some(kind) if class == 6 && !empty => {
            let bytes = if numbers { Cow::Owned(dataset.read_native_bytes()?) } else { Cow::Borrowed(&[][..]) };
            Body::Numeric { re: Numbers { kind, bytes, big: BIG_ENDIAN }, im: None }
        }
        _ if class == 6 && !empty => match parts {
            Some((width, both)) => {
                let all = if numbers { dataset.read_native_bytes()? } else { vec![] };
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
