//! `--share` and `--joined`, by which a campaign divides a run and puts it together.

use std::path::PathBuf;

use crate::campaign::{self, Share};
use crate::study::run::RunFolder;
use crate::work::Failure;
use crate::work::lines::{BOOTSTRAP, Lines, PROFILES};

#[derive(clap::Args)]
pub(super) struct Shared {
    /// Draws only the K-th of N shares of what is asked for
    #[arg(long, value_name = "K/N", default_value_t = Share::WHOLE, hide = true)]
    pub share: Share,
    /// Folder with the runs of all shares: what they have drawn is not drawn again
    #[arg(long, value_name = "DIR", hide = true)]
    pub joined: Option<PathBuf>,
}

impl Shared {
    /// Puts what shares of this run have drawn together in its folder.
    pub fn join(&self, folder: &RunFolder) -> Result<(), Failure> {
        let Some(joined) = &self.joined else { return Ok(()) };
        let shares = campaign::shares(joined)?;
        [BOOTSTRAP, PROFILES].iter().try_for_each(|name| Lines::join(folder, name, &shares))
    }
}
