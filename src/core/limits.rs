//! Bounds on what a file or a number in it may ask for, held before anything of that size is allocated; how files are opened, and how they are replaced.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result, Write};
use std::path::Path;

/// Most bytes of a study.toml, dataset.toml or checkpoint.json: 64 MB, a hundred times the largest that a program has written for us.
pub const CONFIG_BYTES: u64 = 64 << 20;
/// Most bytes of a measurement file: 32 GB, an hour of a hundred channels at 10 kHz as text.
pub const DATA_BYTES: u64 = 32 << 30;
/// Most bytes of one line of a text file: 16 MB, a million columns. A text is read by its lines, so what has no line ends is held whole.
pub const LINE_BYTES: usize = 16 << 20;
/// Largest magnitude of a number that is measured or declared, in SI: 1e50. Numbers are squared to be weighed, and divided by up to the fourth
/// power of a frequency: the sixth power of this one is still a number.
pub const MAGNITUDE: f64 = 1e50;
/// Most bodies one `[[body]]` or `[[part]]` stands for, by `count` or by its modal basis: 100 000; a frequency response of so many takes a
/// minute.
pub const COUNT: i64 = 100_000;
/// Most bodies of a model, all its `[[body]]` together: 200 000, a gigabyte of names, places and matrices.
pub const BODIES: usize = 200_000;
/// Most samples, or time steps, of one record that is computed: 20 million, a gigabyte for six channels.
pub const STEPS: f64 = 2e7;

/// Opens a file to be read. Devices, pipes and folders are refused before they are opened: a pipe waits for a writer, a device has no end.
pub fn open(path: &Path) -> Result<File> {
    let regular = |data: std::fs::Metadata| match data.is_file() {
        true => Ok(()),
        false => Err(Error::new(ErrorKind::InvalidInput, if data.is_dir() { "it is a folder" } else { "it is no regular file" })),
    };
    regular(std::fs::metadata(path)?)?;
    let file = File::open(path)?;
    regular(file.metadata()?)?;
    Ok(file)
}

/// Opens a regular file of at most `most` bytes; its length with it.
pub fn bounded(path: &Path, most: u64) -> Result<(File, u64)> {
    let file = open(path)?;
    let length = file.metadata()?.len();
    if length > most { Err(long(most)) } else { Ok((file, length)) }
}

fn long(most: u64) -> Error {
    Error::new(ErrorKind::FileTooLarge, format!("it is longer than {} MB", most >> 20))
}

/// The whole of a regular file of at most `most` bytes.
pub fn bytes(path: &Path, most: u64) -> Result<Vec<u8>> {
    let (file, length) = bounded(path, most)?;
    let mut bytes = Vec::new();
    let asked = usize::try_from(length).map_err(|_| long(most))?;
    bytes.try_reserve_exact(asked).map_err(|_| Error::new(ErrorKind::OutOfMemory, format!("{length} bytes do not fit into memory")))?;
    // A file that grows meanwhile is read as far as it was.
    file.take(length).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The text of a regular file of at most [`CONFIG_BYTES`].
pub fn text(path: &Path) -> Result<String> {
    String::from_utf8(bytes(path, CONFIG_BYTES)?).map_err(|_| Error::new(ErrorKind::InvalidData, "it is not UTF-8 text"))
}

/// Puts `bytes` in the place of a file in one step, by a temporary file beside it that takes its name: a crash leaves the old file or the new one, never a part of one.
/// The file keeps its permissions; a new one has those of any new file.
///
/// # Errors
/// A folder that is missing or cannot be written, a full disk, a folder of that name.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut temporary = tempfile::NamedTempFile::new_in(folder).map_err(unnamed)?;
    temporary.as_file_mut().write_all(bytes)?;
    permissions(path, temporary.as_file())?;
    temporary.as_file().sync_all()?;
    temporary.persist(path).map(|_| ()).map_err(|e| e.error)
}

/// The error without the name of the temporary file, which means nothing to whoever asked for another. The library puts it behind the words
/// of the system and hands out neither by itself.
fn unnamed(e: Error) -> Error {
    let text = e.to_string();
    text.split_once(" at path ").map_or_else(|| Error::from(e.kind()), |(words, _)| Error::new(e.kind(), words.to_string()))
}

/// A temporary file is private.
fn permissions(path: &Path, temporary: &File) -> Result<()> {
    if let Ok(old) = std::fs::metadata(path) {
        return temporary.set_permissions(old.permissions());
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        temporary.set_permissions(std::fs::Permissions::from_mode(0o644))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_regular_files_of_bounded_size() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a");
        std::fs::write(&file, "twelve bytes").unwrap();
        assert_eq!(bytes(&file, 12).unwrap(), b"twelve bytes");
        assert_eq!(bytes(&file, 11).unwrap_err().kind(), ErrorKind::FileTooLarge);
        assert_eq!(bounded(&file, 11).unwrap_err().kind(), ErrorKind::FileTooLarge);
        assert!(open(folder.path()).unwrap_err().to_string().contains("folder"));
        #[cfg(unix)]
        assert!(open(Path::new("/dev/zero")).unwrap_err().to_string().contains("regular"));
    }

    #[test]
    fn a_file_is_replaced_whole_and_keeps_its_permissions() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a");
        replace(&file, b"one").unwrap();
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = || std::fs::metadata(&file).unwrap().permissions().mode() & 0o777;
            assert_eq!(mode(), 0o644);
            std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o600)).unwrap();
            replace(&file, b"another").unwrap();
            assert_eq!(mode(), 0o600);
        }
        // Whoever reads the old file meanwhile reads it to its end: it is another file.
        let mut old = open(&file).unwrap();
        replace(&file, b"two").unwrap();
        let mut text = String::new();
        old.read_to_string(&mut text).unwrap();
        assert!(text == "another" || text == "one");
        assert_eq!(std::fs::read(&file).unwrap(), b"two");
        // Nothing stands beside it, and where the name is taken by a folder nothing changes.
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        assert!(replace(folder.path(), b"three").is_err());
        // What is said names no file but the one that was asked for.
        let e = replace(&folder.path().join("none/a"), b"four").unwrap_err();
        assert!(e.kind() == ErrorKind::NotFound && !e.to_string().contains("none"), "{e}");
    }
}
