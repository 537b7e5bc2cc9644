//! A new study from files that are dropped on the page. They lie in a folder for temporary files until the reader has seen what is in them
//! and writes the study by name into the folder that is served.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde_json::{Value, json};

use crate::work::Failure;
use crate::work::new::{self, Correction, Looked};

use super::found;

/// Files of a basket at most.
const FILES: usize = 64;
/// Bytes of a file, and of a basket, at most; larger ones are read by `misfit new`.
const FILE: u64 = 128 << 20;
const BASKET: u64 = 512 << 20;
/// Baskets that are kept, one a page that makes a study; the oldest goes where there is another.
const BASKETS: usize = 4;
/// Characters of a file's name at most.
const NAME: usize = 120;

/// Files of one page.
struct Basket {
    id: u64,
    /// Deleted with it.
    folder: tempfile::TempDir,
    files: Mutex<Vec<Dropped>>,
}

#[derive(Clone)]
struct Dropped {
    name: String,
    bytes: u64,
    whole: bool,
}

/// The baskets of a server.
#[derive(Default)]
pub struct Baskets(Mutex<(u64, VecDeque<Arc<Basket>>)>);

fn lock<T>(m: &Mutex<T>) -> MutexGuard<'_, T> {
    m.lock().unwrap_or_else(PoisonError::into_inner)
}

fn refused(place: &str, message: impl Into<String>, accepted: &str) -> Failure {
    Failure::new("serve", place, message, accepted)
}

impl Baskets {
    /// An empty one.
    pub fn open(&self) -> Result<Value, Failure> {
        let cannot =
            |e: std::io::Error| refused("basket", format!("no folder for the files: {e}"), "a folder for temporary files with space");
        let folder = tempfile::Builder::new().prefix("misfit-dropped-").tempdir().map_err(cannot)?;
        let mut all = lock(&self.0);
        all.0 += 1;
        let id = all.0;
        all.1.push_back(Arc::new(Basket { id, folder, files: Mutex::default() }));
        while all.1.len() > BASKETS {
            all.1.pop_front();
        }
        Ok(json!({ "basket": id, "file_bytes": FILE, "files": FILES }))
    }

    fn get(&self, id: u64) -> Result<Arc<Basket>, Failure> {
        let found = lock(&self.0).1.iter().find(|b| b.id == id).cloned();
        found.ok_or_else(|| refused("basket", "these files are not kept any more", "to drop them again"))
    }

    /// Takes note of a file that comes next; one of the same name is replaced.
    pub fn announce(&self, id: u64, name: &str, bytes: u64) -> Result<Value, Failure> {
        let basket = self.get(id)?;
        let odd = |c: char| c.is_control() || matches!(c, '/' | '\\' | ':');
        if name.is_empty() || name.starts_with('.') || name.chars().count() > NAME || name.chars().any(odd) {
            return Err(refused(name, "it is no name of a file that is written here", "a name without a path, at most 120 characters"));
        }
        if bytes == 0 || bytes > FILE {
            let message = format!("the file has {} MB", bytes >> 20);
            return Err(refused(
                name,
                if bytes == 0 { "the file is empty".into() } else { message },
                "1 byte to 128 MB; `misfit new` reads larger files",
            ));
        }
        let mut files = lock(&basket.files);
        let others: u64 = files.iter().filter(|f| f.name != name).map(|f| f.bytes).sum();
        if others + bytes > BASKET {
            return Err(refused(name, "the files have more than 512 MB together", "fewer files; `misfit new` reads them all"));
        }
        let place = files.iter().position(|f| f.name == name);
        if place.is_none() && files.len() >= FILES {
            return Err(refused(name, format!("more than {FILES} files"), "fewer files; `misfit new` reads them all"));
        }
        let file = Dropped { name: name.into(), bytes, whole: false };
        match place {
            Some(k) => files[k] = file,
            None => files.push(file),
        }
        Ok(json!({ "file": place.unwrap_or(files.len() - 1) }))
    }

    /// Where an announced file is written, and its bytes.
    pub fn place(&self, id: u64, file: usize) -> Result<(PathBuf, u64), Failure> {
        let basket = self.get(id)?;
        let known = lock(&basket.files).get(file).cloned();
        let known = known.ok_or_else(|| refused("basket", "this file was not announced", "a file whose name and size were sent before"))?;
        Ok((basket.folder.path().join(known.name), known.bytes))
    }

    /// The announced file has come.
    pub fn came(&self, id: u64, file: usize) -> Result<Value, Failure> {
        if let Some(f) = lock(&self.get(id)?.files).get_mut(file) {
            f.whole = true;
        }
        Ok(json!({ "file": file }))
    }

    /// What is found in the files, corrected as the reader says.
    pub fn look(&self, id: u64, corrections: &[Correction]) -> Result<Value, Failure> {
        let basket = self.get(id)?;
        Ok(found::told(&basket.looked(corrections)?, basket.folder.path()))
    }

    /// Writes the study into `dir`.
    pub fn write(&self, id: u64, corrections: &[Correction], dir: &Path) -> Result<Value, Failure> {
        let basket = self.get(id)?;
        // A link would lead out of the folder that is served.
        if std::fs::symlink_metadata(dir).is_ok() {
            return Err(refused(&dir.display().to_string(), "a file or folder of this name is there", "a new name"));
        }
        let looked = basket.looked(corrections)?;
        let Some(scaffold) = &looked.scaffold else {
            return Err(refused("", "the files hold no test", "histories of force and displacement, FRFs, or tables of modes"));
        };
        let (problem, _) = new::create(dir, &looked.files, scaffold)?;
        Ok(json!({ "to_confirm": scaffold.to_confirm, "problem": problem.map(|p| p.problem()), "files": names(&looked) }))
    }
}

fn names(looked: &Looked) -> Vec<String> {
    looked.files.iter().map(|f| new::named(f)).collect()
}

impl Basket {
    fn looked(&self, corrections: &[Correction]) -> Result<Looked, Failure> {
        let files: Vec<PathBuf> = lock(&self.files).iter().filter(|f| f.whole).map(|f| self.folder.path().join(&f.name)).collect();
        if files.is_empty() {
            return Err(refused("basket", "no file has come yet", "files dropped on the page"));
        }
        new::look(&files, None, corrections).map_err(|f| found::inside(&f, self.folder.path()))
    }
}

/// Folder of a study of this name in the one that is served.
pub fn folder(served: Option<&Path>, name: &str) -> Result<PathBuf, Failure> {
    let Some(served) = served else {
        let message = "one study is served: a new one has no place beside it";
        return Err(refused(name, message, "`misfit serve FOLDER` with the folder that holds the studies"));
    };
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if name.is_empty() || name.len() > 60 || !name.chars().all(plain) {
        return Err(refused(name, "it is no name of a study that is written here", "letters, digits, `-` and `_`, at most 60"));
    }
    Ok(served.join(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_sizes_are_bounded() {
        let baskets = Baskets::default();
        let id = baskets.open().unwrap()["basket"].as_u64().unwrap();
        for name in ["", "../a.csv", "a/b.csv", "a\\b.csv", "c:a.csv", ".hidden.csv", "a\u{0}.csv", &"x".repeat(200)] {
            assert!(baskets.announce(id, name, 10).is_err(), "{name}");
        }
        assert!(baskets.announce(id, "a.csv", 0).is_err() && baskets.announce(id, "a.csv", FILE + 1).is_err());
        for k in 0..4 {
            baskets.announce(id, &format!("{k}.csv"), FILE).unwrap();
        }
        assert!(baskets.announce(id, "5.csv", 1).is_err(), "more than a basket holds");
        assert_eq!(baskets.announce(id, "1.csv", 7).unwrap()["file"], 1, "the same name is the same file");
        assert!(baskets.place(id, 4).is_err() && baskets.place(99, 0).is_err());
        assert!(baskets.look(id, &[]).is_err(), "nothing has come");
        for _ in 0..BASKETS {
            baskets.open().unwrap();
        }
        assert!(baskets.announce(id, "a.csv", 10).is_err(), "the oldest is gone");
    }

    #[test]
    fn a_study_is_written_inside_the_folder_alone() {
        let served = Path::new("/srv/studies");
        assert_eq!(folder(Some(served), "new-1").unwrap(), served.join("new-1"));
        for name in ["", "..", "a/b", "a.b", "näme", "a b", &"x".repeat(61)] {
            assert!(folder(Some(served), name).is_err(), "{name}");
        }
        assert!(folder(None, "new").is_err());
    }
}
