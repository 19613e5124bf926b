//! Photos are announced before they are needed: those of the next batch, and at the size of the stage that it will be in.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::training::{MemoryViews, config, damaged, photos, scene_options};
use litetex_gs::Result;
use litetex_gs::backend::TargetImage;
use litetex_gs::camera::Camera;
use litetex_gs::cpu::CpuBackend;
use litetex_gs::selftest::{SceneOptions, random_scene};
use litetex_gs::train::density::Components;
use litetex_gs::train::{Control, TrainConfig, TrainState, train};
use litetex_gs::views::{Split, ViewSource, WantedPhoto};
use std::sync::{Arc, Mutex, MutexGuard};

#[derive(Default)]
struct Notes {
    /// What was announced, the last time and before.
    last: Vec<WantedPhoto>,
    before: Vec<WantedPhoto>,
    /// Photos that were used, and whether they had been announced a batch earlier.
    used: Vec<(WantedPhoto, bool)>,
}

/// Views that note what is announced and used.
struct Noted {
    views: MemoryViews,
    notes: Mutex<Notes>,
}

impl Noted {
    fn notes(&self) -> MutexGuard<'_, Notes> {
        self.notes.lock().unwrap()
    }

    fn used(&self, wanted: WantedPhoto) {
        let mut notes = self.notes();
        let early = notes.before.contains(&wanted);
        notes.used.push((wanted, early));
    }
}

impl ViewSource for Noted {
    fn num_views(&self) -> usize {
        self.views.num_views()
    }
    fn name(&self, view: usize) -> &str {
        self.views.name(view)
    }
    fn split(&self, view: usize) -> Split {
        self.views.split(view)
    }
    fn camera(&self, view: usize) -> Camera {
        self.views.camera(view)
    }
    fn target(&self, view: usize) -> Result<Arc<TargetImage>> {
        self.used(WantedPhoto { view, reduced_px: None });
        self.views.target(view)
    }
    fn reduced_target(&self, view: usize, size_px: (u32, u32)) -> Result<Arc<TargetImage>> {
        self.used(WantedPhoto { view, reduced_px: Some(size_px) });
        self.views.reduced_target(view, size_px)
    }
    fn prefetch(&self, wanted: &[WantedPhoto]) {
        let mut notes = self.notes();
        let last = std::mem::replace(&mut notes.last, wanted.to_vec());
        notes.before.extend(last);
    }
}

#[test]
fn photos_of_a_stage_are_announced_before_it_begins() {
    let scene = random_scene(&SceneOptions { width_px: 256, height_px: 192, ..scene_options() });
    let views = Noted { views: photos(&scene), notes: Mutex::default() };
    let config =
        TrainConfig { components: Components::default(), eval_every: 0, save_every: 0, ..config(60) };
    let start = TrainState::fresh(damaged(&scene));
    let mut first = true;
    let mut sink = |_: litetex_gs::train::TrainEvent<'_>| {
        // What the analysis before the first step used.
        if std::mem::take(&mut first) {
            views.notes().used.clear();
        }
        Ok(Control::Continue)
    };
    train(&config, &mut CpuBackend::new(Some(2)).unwrap(), &views, start, &mut sink).unwrap();

    let notes = views.notes();
    // The test view is announced by the evaluation at the end.
    let used: Vec<_> = notes.used.iter().filter(|(wanted, _)| wanted.view != 0).collect();
    let mut sizes: Vec<_> = used.iter().map(|(wanted, _)| wanted.reduced_px).collect();
    sizes.dedup();
    assert!(sizes.len() > 2, "several stages: {sizes:?}");
    let late: Vec<WantedPhoto> = used.iter().filter(|(_, early)| !early).map(|(wanted, _)| *wanted).collect();
    // Negative control: nothing can be announced before the first batch, of one step here.
    assert_eq!(late, [used[0].0]);
    // Smaller photos are used once, then kept.
    for (at, (wanted, _)) in used.iter().enumerate().filter(|(_, (wanted, _))| wanted.reduced_px.is_some()) {
        assert!(!used[..at].iter().any(|(earlier, _)| earlier == wanted), "{wanted:?}");
    }
}
