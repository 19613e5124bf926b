//! What a server shows: a session, the bytes of its scene, photos by number. Callers change it while it is served.

use litetex_exporters::html::{Session, SessionAsset, SessionPhoto, SessionTraining};
use std::fs::File;
use std::io::{self, Cursor, Read};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The bytes of a scene.
#[derive(Clone)]
pub enum AssetBytes {
    Memory(Arc<[u8]>),
    /// A file, opened anew for each request.
    File(PathBuf),
}

impl AssetBytes {
    /// A reader of the bytes as they are now, and their number.
    ///
    /// # Errors
    /// If the file is gone, or is no regular file any more.
    pub fn open(&self) -> io::Result<(u64, Box<dyn Read + Send>)> {
        match self {
            Self::Memory(bytes) => Ok((bytes.len() as u64, Box::new(Cursor::new(Arc::clone(bytes))))),
            Self::File(path) => {
                litetex_exporters::regular_file_bytes(path).map_err(io::Error::other)?;
                let file = File::open(path)?;
                Ok((file.metadata()?.len(), Box::new(file)))
            }
        }
    }
}

/// Photos by their number in the session.
pub trait Photos: Send + Sync {
    /// A photo as PNG; `None` if there is none of this number.
    ///
    /// # Errors
    /// What decoding it reports.
    fn png(&self, index: usize) -> Option<io::Result<Vec<u8>>>;
}

/// What is shown; shared between the server and the one who changes it.
#[derive(Default)]
pub struct Shown {
    state: Mutex<State>,
    /// One photo is decoded at a time: whoever asks for many must not slow a training down.
    photos: Mutex<Option<Arc<dyn Photos>>>,
}

struct State {
    session: Session,
    asset: Option<AssetBytes>,
    asked: Option<Instant>,
}

impl Default for State {
    fn default() -> Self {
        Self { session: Session::new(""), asset: None, asked: None }
    }
}

impl Shown {
    /// Shows a scene in place of the one before. `asset` describes it; address and revision are filled in.
    pub fn set_asset(&self, title: &str, asset: SessionAsset, bytes: AssetBytes) {
        let mut state = self.state();
        let revision = state.session.asset.as_ref().map_or(1, |before| before.revision + 1);
        state.session.asset = Some(SessionAsset { url: Some("asset".to_owned()), revision, ..asset });
        title.clone_into(&mut state.session.title);
        state.asset = Some(bytes);
    }

    /// Names what is shown where there is no scene yet.
    pub fn set_title(&self, title: &str) {
        title.clone_into(&mut self.state().session.title);
    }

    /// Tells how the training stands; its revision is filled in.
    pub fn set_training(&self, training: SessionTraining) {
        let mut state = self.state();
        let before = state.session.training.as_ref();
        let revision = before.map_or(1, |before| {
            before.revision
                + u64::from(SessionTraining { revision: before.revision, ..training.clone() } != *before)
        });
        state.session.training = Some(SessionTraining { revision, ..training });
    }

    /// Offers photos, listed in their order; addresses are filled in.
    pub fn set_photos(&self, mut list: Vec<SessionPhoto>, photos: Arc<dyn Photos>) {
        for (index, photo) in list.iter_mut().enumerate() {
            photo.url = format!("photo/{index}");
        }
        self.state().session.photos = Some(list);
        *self.photos.lock().unwrap_or_else(PoisonError::into_inner) = Some(photos);
    }

    /// Whether anyone has looked within this time.
    pub fn is_watched(&self, within: Duration) -> bool {
        self.state().asked.is_some_and(|at| at.elapsed() < within)
    }

    /// The session, with addresses under this prefix.
    pub(super) fn session(&self, prefix: &str) -> Session {
        let mut state = self.state();
        state.asked = Some(Instant::now());
        let mut session = state.session.clone();
        drop(state);
        let assets = session.asset.iter_mut().filter_map(|asset| asset.url.as_mut());
        let photos = session.photos.iter_mut().flatten().map(|photo| &mut photo.url);
        assets.chain(photos).for_each(|url| *url = format!("{prefix}{url}"));
        session
    }

    /// The scene; `None` if there is none yet.
    pub(super) fn asset(&self) -> Option<AssetBytes> {
        self.state().asset.clone()
    }

    /// See [`Photos::png`].
    pub(super) fn photo(&self, index: usize) -> Option<io::Result<Vec<u8>>> {
        self.photos.lock().unwrap_or_else(PoisonError::into_inner).as_ref()?.png(index)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
