//! `litetex view`: shows a scene in the browser, and follows a run while it trains.

use super::sources::{check_kind, load_scene, open_photos};
use super::stamp::Stamp;
use super::view_photos::{no_photos, not_shown, offer_photos};
use super::view_run::RunWatch;
use super::view_scene::{name_of, served};
use crate::viewer::{Server, Shown};
use litetex_exporters::Format;
use litetex_gs::console::values::whole;
use litetex_gs::console::{Interrupt, Log, Output};
use litetex_gs::run::{RUN_OR_CHECKPOINT, is_run};
use litetex_gs::verify::BakedScene;
use litetex_gs::{Error, Result, usage};
use serde_json::json;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Time between two looks for Ctrl-C.
const NAP: Duration = Duration::from_millis(50);

/// Time between two looks at the files of a run.
const LOOK_INTERVAL: Duration = Duration::from_secs(1);

/// Show a scene in the browser, or follow a run while it trains
///
/// Serves the scene to this machine's browser only, until Ctrl-C, and prints the address, which nobody else should know:
/// whoever has it may read the scene. Of a run, shows the last checkpoint, or what "litetex train --view" has written since;
/// files that change are shown again.
#[derive(clap::Args)]
pub struct ViewArgs {
    /// An asset, a run or a checkpoint; without one, the page asks for a file
    #[arg(value_name = "FILE|RUN")]
    source: Option<PathBuf>,
    /// Show the photos of this capture [default: that of the run]
    #[arg(long, value_name = "DIR", requires = "source")]
    capture: Option<PathBuf>,
    #[command(flatten)]
    server: ServerArgs,
}

/// Arguments of commands that serve a page.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct ServerArgs {
    /// Port of the page's address [default: any that is free]
    #[arg(long, value_name = "N", value_parser = whole::<u16>(1..=u64::MAX))]
    pub port: Option<u16>,
    /// Print the address without opening the browser, on whose command line other users of the machine may see it
    #[arg(long)]
    pub no_open: bool,
}

/// Serves until Ctrl-C.
pub fn run(args: &ViewArgs, log: &Log) -> Result<Output> {
    let interrupt = Interrupt::listen(log, "closing the viewer")?;
    let shown = Arc::new(Shown::default());
    let mut watch = show(args, &shown, log)?;
    let server = start(args.server.port, "--port", &shown)?;
    announce(&server, args.server.no_open, log)?;
    let mut looked = Instant::now();
    while !interrupt.is_requested() {
        std::thread::sleep(NAP);
        if let Some(watch) = watch.as_mut().filter(|_| looked.elapsed() >= LOOK_INTERVAL) {
            watch.look(log);
            looked = Instant::now();
        }
    }
    Err(Error::Interrupted)
}

/// What is looked at again and again.
enum Watch {
    Run(Box<RunWatch>),
    File { shown: Arc<Shown>, stamp: Stamp },
}

impl Watch {
    /// Shows what has changed. What cannot be read is reported, and tried again once it changes.
    fn look(&mut self, log: &Log) {
        match self {
            Self::Run(run) => run.look(log),
            Self::File { shown, stamp } => {
                let Some(now) = Stamp::of(stamp.path.clone()).filter(|now| now != stamp) else { return };
                *stamp = now;
                let shown = load_scene(&stamp.path, log).and_then(|(scene, _)| show_scene(&scene, shown));
                if let Err(error) = shown {
                    not_shown(&error, log);
                }
            }
        }
    }
}

/// Refuses what is neither a run, a checkpoint nor an asset, by its name.
fn refuse_other_kinds(source: &Path) -> Result<()> {
    if source.is_dir() && !source.join("checkpoints").is_dir() {
        let what = format!(
            "a folder without checkpoints; expected {} or {RUN_OR_CHECKPOINT}; a capture is to be trained first: litetex train",
            Format::all_named()
        );
        return Err(Error::invalid(source, what));
    }
    check_kind(source, "")
}

/// Reads what is to be shown.
fn show(args: &ViewArgs, shown: &Arc<Shown>, log: &Log) -> Result<Option<Watch>> {
    let Some(source) = &args.source else { return Ok(None) };
    if source.is_dir() && is_run(source) {
        let run = RunWatch::start(source, args.capture.as_deref(), Arc::clone(shown), log)?;
        return Ok(Some(Watch::Run(Box::new(run))));
    }
    refuse_other_kinds(source)?;
    // Before it is read: what changes meanwhile is read again.
    let stamp = Stamp::of(source.clone());
    let (scene, trained) = load_scene(source, log)?;
    let capture = match (&trained, args.capture.as_deref()) {
        (Some(trained), named) => trained.open_capture(named).map(Some),
        (None, named) => open_photos(&scene, None, named, log),
    };
    match capture {
        // What the user named must be there.
        Err(error) if args.capture.is_some() => return Err(error),
        Err(error) => no_photos(&error, log),
        Ok(capture) => offer_photos(capture.map(Arc::new), shown),
    }
    show_scene(&scene, shown)?;
    Ok(stamp.map(|stamp| Watch::File { shown: Arc::clone(shown), stamp }))
}

fn show_scene(scene: &BakedScene, shown: &Shown) -> Result<()> {
    let (asset, bytes) = served(scene)?;
    let title = match scene.asset.provenance.title.as_str() {
        "" => name_of(&scene.path),
        title => title.to_owned(),
    };
    shown.set_asset(&title, asset, bytes);
    Ok(())
}

/// Starts a server. `option` is what names the port.
///
/// # Errors
/// [`Error::Usage`] if the port is taken or not allowed, [`Error::Device`] for other refusals of the system.
pub fn start(port: Option<u16>, option: &str, shown: &Arc<Shown>) -> Result<Server> {
    Server::start(port.unwrap_or(0), Arc::clone(shown)).map_err(|e| match (port, e.kind()) {
        (Some(port), ErrorKind::AddrInUse | ErrorKind::PermissionDenied) => {
            usage!("{option} {port}: {e}; choose another port, or leave {option} out")
        }
        _ => Error::Device(format!("cannot serve the page: {e}")),
    })
}

/// Prints the address and opens the browser.
///
/// # Errors
/// [`Error::Io`] if the address cannot be printed.
pub fn announce(server: &Server, no_open: bool, log: &Log) -> Result<()> {
    let url = server.url();
    log.print(Output::new("litetex-view/1", json!({ "url": url }), format!("{url}\n")))?;
    log.info("the page is for this machine's browser; Ctrl-C closes it");
    if !no_open && let Err(error) = open::that_detached(&url) {
        let what = format!("no browser could be opened ({error}); open the address in one, or use --no-open");
        log.warn("no-browser", &what, 1);
    }
    Ok(())
}
