//! Progress of an export, whose time goes into rendering views, on standard error: a bar on a terminal, elsewhere a plain line
//! every few seconds, or JSON.

use super::asset_args::AssetArgs;
use super::progress::{BAR_INTERVAL, LINE_INTERVAL, bar};
use indicatif::ProgressBar;
use litetex_exporters::{Format, SplatAsset};
use litetex_gs::console::Log;
use litetex_gs::stand_in::VIEWS_TO_RENDER;
use litetex_gs::text::{counted, format_duration};
use litetex_gs::verify::{EXPORT_VIEWS, VIEWS_AROUND, sh_bits_views};
use serde_json::json;
use std::cell::Cell;
use std::path::PathBuf;
use std::time::Instant;

/// About how many views an export renders.
pub fn views_to_render(asset: &SplatAsset, outputs: &[PathBuf], args: &AssetArgs) -> u64 {
    let all = asset.cameras.len();
    let training = asset.cameras.iter().filter(|c| !c.held_out).count();
    let shown = if training == 0 { VIEWS_AROUND } else { training };
    let verified =
        if args.no_verify { 0 } else { [shown, all - training].map(|n| n.min(EXPORT_VIEWS)).iter().sum() };
    let of_file = |path: &PathBuf| {
        let Some(format) = Format::from_path(path) else { return 0 };
        let found = args.goal_of(format).map_or(0, |goal| goal.views_to_render(training, all));
        // The file, and in glTF and USD twice its fallback.
        let images =
            if format.keeps_textures() && !matches!(format, Format::Ltgs | Format::Html) { 3 } else { 1 };
        let bits = if format == Format::Spz { sh_bits_views(asset, args.quality(), training) } else { 0 };
        let stand_in = if args.puts_stand_in(format, args.quality()) { VIEWS_TO_RENDER } else { 0 };
        found + bits + images * verified + stand_in
    };
    let edited = if args.min_contribution.is_some() { training } else { 0 };
    (edited + 2 * verified + outputs.iter().map(of_file).sum::<usize>()) as u64
}

/// Progress of work that renders about as many views as it was said to.
pub struct ViewsProgress<'a> {
    log: &'a Log,
    bar: Option<ProgressBar>,
    views: u64,
    done: Cell<u64>,
    start: Instant,
    shown: Cell<Instant>,
}

impl<'a> ViewsProgress<'a> {
    /// A display of work that renders this number of views, by estimate.
    pub fn new(log: &'a Log, views: u64) -> Self {
        let bar = bar(log, views);
        log.attach_bar(bar.clone());
        let now = Instant::now();
        Self { log, bar, views, done: Cell::new(0), start: now, shown: Cell::new(now) }
    }

    /// Takes in that another view is about to be rendered, and shows it if it is time to.
    pub fn view(&self) {
        let done = self.done.get();
        self.done.set(done + 1);
        let interval = if self.bar.is_some() { BAR_INTERVAL } else { LINE_INTERVAL };
        if done == 0 || self.shown.get().elapsed() < interval {
            return;
        }
        self.shown.set(Instant::now());
        let views = self.views.max(done + 1);
        let eta_secs = self.start.elapsed().as_secs_f64() * (views - done) as f64 / done as f64;
        let text = format!("ETA {}", format_duration(eta_secs));
        if let Some(bar) = &self.bar {
            bar.set_length(views);
            bar.set_position(done);
            bar.set_message(text);
            return;
        }
        let fields = json!({ "views_done": done, "views": views, "eta_secs": eta_secs });
        self.log.event("progress", &format!("view {done} of about {views}: {text}"), fields);
    }
}

impl Drop for ViewsProgress<'_> {
    fn drop(&mut self) {
        self.log.attach_bar(None);
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
        self.log.detail(&format!(
            "{} rendered, about {} expected",
            counted(self.done.get() as usize, "view"),
            self.views
        ));
    }
}
