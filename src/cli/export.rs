//! `litetex export`, also called `convert`: assets from runs and from each other.

use super::asset_args::{AssetArgs, CropBox};
use super::outputs;
use super::scale_from::{ScaleFrom, measure, parse_scale_from};
use super::sources::{load_layers, open_photos, read_limits, say_up};
use super::views_progress::{ViewsProgress, views_to_render};
use litetex_exporters::spz::{ShBits, SpzOptions};
use litetex_exporters::{
    AssetCamera, Format, METRES, ORIGIN_OPTION, Quality, SplatAsset, UNKNOWN_SCALE, WriteOptions, Written,
    num_sh_coefficients, read_asset, read_fallback, stage_asset,
};
use litetex_gs::camera::up::direction_text;
use litetex_gs::capture::Capture;
use litetex_gs::console::values::whole;
use litetex_gs::console::{Interrupt, Log, Output, columns, device, path_text};
use litetex_gs::report_page::FileFigures;
use litetex_gs::run::{Scale, Trained, run_of_checkpoint};
use litetex_gs::text::{format_bytes, format_count};
use litetex_gs::verify::{
    Backends, BakedScene, Contribution, EXPORT_VIEWS, ExpectedImages, GoOn, PhotoPsnr, QualityLimits,
    ReadBack, Rounding, SceneRenderer, Verdict, evenly_spread, find_rounding, find_sh_bits, verify,
};
use litetex_gs::{Error, Report, Result, usage};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Write a trained scene as an asset, or an asset in another format
///
/// The extension of each file determines its format. Every file is read back, rendered and compared with the scene before
/// it is moved into place; test PSNR is that of the scene and of the file on the photos held out, if they are still there.
/// "litetex convert" is the same command.
#[derive(clap::Args)]
pub struct ExportArgs {
    /// A run, a checkpoint or an asset
    #[arg(value_name = "RUN|CHECKPOINT|ASSET")]
    source: PathBuf,
    /// Files to write
    #[arg(value_name = "FILE", required_unless_present_any = ["out", "scale_from"])]
    files: Vec<PathBuf>,
    /// File to write; several may follow
    #[arg(long, short, value_name = "FILE", num_args = 1..)]
    out: Vec<PathBuf>,
    /// Keep only the first N layers of a .ltgs file, or one inside glTF, which are a coarser scene
    #[arg(long, value_name = "N", value_parser = whole::<u32>(1..=u64::MAX), help_heading = "Scene")]
    layers: Option<u32>,
    /// Two points and their distance, such as 'A.jpg:10,20 A.jpg:300,40 = 1.2m', by which a unit of the files becomes a metre; kept
    /// beside the run for later exports, "none" forgets it. Points: VIEW:x,y, a pixel of the stored photo, which shows the surface
    /// there; VIEW:x,y+VIEW:x,y, the same point in two views; X,Y,Z, in the capture's frame. Units: mm, cm, m, in, ft
    #[arg(long, value_name = "POINTS", value_parser = parse_scale_from, allow_hyphen_values = true, conflicts_with = "scale", help_heading = "Scene")]
    scale_from: Option<ScaleFrom>,
    #[command(flatten)]
    asset: AssetArgs,
    /// Where to render for the comparison
    #[arg(long, value_name = "NAME", default_value = "auto", help_heading = "Device")]
    device: String,
}

/// How scenes for formats without textures are better trained.
const TRAIN_INSTEAD: &str = "litetex train --for engine";

/// Loads, writes and verifies.
pub fn run(args: &ExportArgs, log: &Log) -> Result<Output> {
    listen(log)?;
    let source = args.source.is_file().then_some(args.source.as_path());
    let out = [&*args.files, &args.out].concat();
    outputs::check(source, &out, &args.asset)?;
    let (mut scene, trained) = load_layers(&args.source, args.layers, log)?;
    if let Some(from) = &args.scale_from {
        scale(from, &mut scene, trained.as_ref(), log)?;
    }
    if out.is_empty() {
        let words = scene.asset.provenance.scale_words();
        return Ok(Output::new(
            "litetex-export/1",
            json!({ "files": [], "scale": words }),
            format!("{words}\n"),
        ));
    }
    if let Some(up) = args.asset.up.and_then(|up| up.in_capture) {
        scene.asset.set_up(up);
        scene.asset.provenance.up = format!("{}: requested with --up", direction_text(up));
    }
    say_up(&scene.asset, log);
    Ok(write_all((scene, trained.as_ref()), &out, &args.asset, &args.device, log)?.output())
}

/// Measures the scale of a scene, or forgets it, for this export and, beside a run, for later ones.
fn scale(from: &ScaleFrom, scene: &mut BakedScene, trained: Option<&Trained>, log: &Log) -> Result<()> {
    let run = trained.and_then(|trained| run_of_checkpoint(&trained.path));
    let (factor, words) = match from {
        ScaleFrom::None => {
            let had_one = run.as_deref().map_or(Ok(false), Scale::remove)?;
            log.info(if had_one { "the scale of the run is forgotten" } else { "the run had no scale" });
            let stated = trained.map(Trained::scale_words_unmeasured);
            (1.0, stated.unwrap_or_else(|| UNKNOWN_SCALE.to_owned()))
        }
        ScaleFrom::Distance(points, metres, text) => {
            let found = measure((points, *metres, text), (scene, trained), log)?;
            if let Some(run) = &run {
                found.store(run)?;
                log.info(&format!(
                    "kept in {} for later exports; --scale-from none forgets it",
                    run.display()
                ));
            }
            (found.metres_per_unit, found.words())
        }
    };
    scene.asset.set_scale(factor);
    scene.asset.provenance.scale = words;
    Ok(())
}

/// Takes over Ctrl-C, before the first file is created: neither probes nor staged files may stay behind.
fn listen(log: &Log) -> Result<Interrupt> {
    Interrupt::listen(log, "removing unfinished files")
}

/// The files that were written, in order, and the error that stopped the rest, if one did.
#[must_use]
pub struct Exports {
    files: Vec<Exported>,
    stopped: Option<Error>,
}

/// A file and how it compares with the scene; it is in its place only if nothing failed.
struct Exported {
    path: PathBuf,
    written: Written,
    /// Size of the scene's numbers as f32.
    raw_bytes: u64,
    /// `None` if the file was not verified.
    verdict: Option<Verdict>,
    /// On the photos of the test views, if the capture of the run is still there.
    on_test_photos: Option<PhotoPsnr>,
    /// Whether the scene has textures that the format cannot hold.
    loses_textures: bool,
}

/// What all files of an export share.
struct Job<'a> {
    args: &'a AssetArgs,
    device: &'a str,
    go_on: GoOn<'a>,
    log: &'a Log,
}

/// What files are compared with.
struct Verification<'a> {
    renderer: SceneRenderer<'a>,
    expected: ExpectedImages<'a>,
    /// The test views and their photos, for figures that are not checked.
    tests: Option<(ExpectedImages<'a>, &'a Capture)>,
}

impl Exports {
    /// The files that another origin would help: their format cannot hold coordinates as far out as the scene's.
    pub fn files_for_origin(&self, outputs: &[PathBuf]) -> Vec<PathBuf> {
        let names = |text: &String| text.contains(ORIGIN_OPTION);
        let noted = |file: &&Exported| file.written.notes.iter().any(names);
        let mut files: Vec<PathBuf> = self.files.iter().filter(noted).map(|file| file.path.clone()).collect();
        // The one that stopped the rest, and the rest.
        if self.stopped.as_ref().is_some_and(|error| names(&error.to_string())) {
            files.extend_from_slice(&outputs[self.files.len()..]);
        }
        files
    }
}

/// Edits the scene, then writes and verifies each file and puts it in its place if it is right. With the training that it
/// comes from, files are also compared with the photos of the test views.
///
/// # Errors
/// If nothing can be written or rendered. What is wrong with a single file is left to [`Exports::output`].
pub fn write_all(
    (mut scene, trained): (BakedScene, Option<&Trained>),
    outputs: &[PathBuf],
    args: &AssetArgs,
    device: &str,
    log: &Log,
) -> Result<Exports> {
    let interrupt = listen(log)?;
    let progress = ViewsProgress::new(log, views_to_render(&scene.asset, outputs, args));
    let go_on = || {
        progress.view();
        !interrupt.is_requested()
    };
    edit(&mut scene, args, &go_on, log)?;
    scene.asset.validate().map_err(|e| Error::from(e.at(&scene.path)))?;
    let photos = if args.no_verify { None } else { photos_of_tests(&scene, trained, log) };
    let (tests, training): (Vec<_>, Vec<_>) = scene.asset.cameras.iter().cloned().partition(|c| c.held_out);
    let views = [training, tests].map(|cameras| evenly_spread(&cameras, EXPORT_VIEWS));
    let job = Job { args, device, go_on: &go_on, log };
    let mut verification = job.verification(&scene.asset, [&views[0], &views[1]], photos.as_ref())?;
    let mut exports = Exports { files: Vec::new(), stopped: None };
    for path in outputs {
        let next = interrupt.check().and_then(|()| {
            let how = (job.rounding(&scene, path)?, job.spz_options(&scene.asset, path)?);
            job.write_one(&scene.asset, path, how, verification.as_mut())
        });
        match next {
            Ok(exported) => exports.files.push(exported),
            Err(error) => {
                exports.stopped = Some(error);
                break;
            }
        }
    }
    Ok(exports)
}

/// Changes a scene as the arguments say and reports how many splats were left out.
fn edit(scene: &mut BakedScene, args: &AssetArgs, go_on: GoOn<'_>, log: &Log) -> Result<()> {
    let asset = &mut scene.asset;
    let before = asset.num_splats();
    let log_left_out = |gone: usize, why: &str| {
        let [gone, before] = [gone, before].map(|n| format_count(n as u64));
        log.info(&format!("{gone} of {before} splats {why} and are left out"));
    };
    if let Some(floor) = args.min_contribution {
        let training: Vec<_> = asset.cameras.iter().filter(|c| !c.held_out).cloned().collect();
        let mut backend = device::open("cpu", log)?;
        let contribution = Contribution::measure(backend.as_mut(), asset, &training, go_on)?;
        let keep: Vec<bool> = contribution.weight_px.iter().map(|c| *c >= floor).collect();
        log_left_out(asset.retain(&keep), &format!("contribute less than {floor} pixels"));
    }
    if let Some(CropBox { low, high }) = args.crop {
        log_left_out(asset.crop(low, high), "are outside the box");
    }
    if asset.num_splats() == 0 {
        let why = match before {
            0 => "the scene has no splats",
            _ => "--crop and --min-contribution leave no splats",
        };
        return Err(usage!("{}: {why}", scene.path.display()));
    }
    if let Some(factor) = args.scale {
        asset.set_scale(factor);
        asset.provenance.scale =
            format!("{METRES}: a unit of the capture is {factor} m, as requested with --scale");
    }
    if !asset.provenance.scale.is_empty() {
        log.info(&format!("scale: {}", asset.provenance.scale));
    }
    if let Some(origin) = args.origin {
        log.info(&origin.apply(asset));
    }
    let facts = &mut asset.provenance;
    for (field, given) in [
        (&mut facts.title, &args.title),
        (&mut facts.author, &args.author),
        (&mut facts.licence, &args.licence),
        (&mut facts.source, &args.made_from),
    ] {
        if let Some(text) = given {
            field.clone_from(text);
        }
    }
    Ok(())
}

/// The photos of the scene's test views; `None` if there are none, or they are no longer there.
fn photos_of_tests(scene: &BakedScene, trained: Option<&Trained>, log: &Log) -> Option<Capture> {
    if !scene.asset.cameras.iter().any(|c| c.held_out) {
        return None;
    }
    let photos = open_photos(scene, trained, None, log);
    photos.unwrap_or_else(|error| {
        log.warn("no-test-photos", &format!("files are not compared with the test photos: {error}"), 1);
        None
    })
}

impl<'a> Job<'a> {
    /// Renders the scene at training and test views, unless files are not to be verified or it has no cameras.
    fn verification(
        &self,
        asset: &'a SplatAsset,
        [views, tests]: [&'a [AssetCamera]; 2],
        photos: Option<&'a Capture>,
    ) -> Result<Option<Verification<'a>>> {
        let &Self { args, device, go_on, log } = self;
        if args.no_verify {
            log.detail("the files are not verified");
            return Ok(None);
        }
        if views.is_empty() {
            log.warn(
                "not-verified",
                "the files are not verified: the scene has no cameras to render it from; \"litetex verify\" with the photos' \
                 --capture renders the views of a capture",
                1,
            );
            return Ok(None);
        }
        let mut renderer = SceneRenderer::new(device::open(device, log)?, go_on);
        let expected = ExpectedImages::render(&mut renderer, asset, views)?;
        let of_tests =
            |photos| Ok::<_, Error>((ExpectedImages::render(&mut renderer, asset, tests)?, photos));
        let tests = photos.map(of_tests).transpose()?;
        Ok(Some(Verification { renderer, expected, tests }))
    }

    /// How the numbers of a file are rounded. Bounds of size and loss are only for `.ltgs` files.
    fn rounding(&self, scene: &BakedScene, path: &Path) -> Result<Rounding> {
        let &Self { args, device, go_on, log } = self;
        // Lossless files have nothing to look for; bounds contradict them, which the search reports.
        let goal = args
            .goal_of(Format::of(path)?)
            .filter(|goal| goal.quality != Quality::Lossless || goal.own_limits().is_some());
        let Some(goal) = goal else {
            if args.effort.is_some() {
                let what =
                    "--effort applies only to lossy .ltgs and .html files and to glTF files of quality tiny";
                log.warn("effort-not-applied", &format!("{}: {what}", path.display()), 1);
            }
            return Ok(Rounding::plain(args.quality()));
        };
        let of_source = scene.contents.as_ref().and_then(|contents| contents.quality);
        if let Some(lossy) = of_source.filter(|&quality| quality != Quality::Lossless) {
            let (source, lossy) = (scene.path.display(), lossy.name());
            let what = format!("made of {source}, which is of quality {lossy}: the losses of both add up");
            log.warn("lossy-source", &format!("{}: {what}", path.display()), 1);
        }
        if goal != args.rate_goal() {
            let what =
                "--max-size and --max-loss bound only .ltgs files; the file keeps the limits of its quality";
            log.warn("bounds-not-applied", &format!("{}: {what}", path.display()), 1);
        }
        let mut report = Report::default();
        let backends = Backends {
            statistics: &|| device::open("cpu", log),
            rendering: &|| device::open(device, log),
            go_on,
        };
        let rounding = find_rounding(scene, &goal, &backends, &mut report)?;
        log.report(&report);
        Ok(rounding)
    }

    /// How to write a `.spz` file: the bits of its SH coefficients are those that the quality needs.
    fn spz_options(&self, asset: &SplatAsset, path: &Path) -> Result<SpzOptions> {
        let &Self { args, device, go_on, log } = self;
        let options = args.spz();
        if Format::of(path)? != Format::Spz {
            return Ok(options);
        }
        let open = || Ok(SceneRenderer::new(device::open(device, log)?, go_on));
        let sh_bits = find_sh_bits(asset, args.quality(), open)?;
        if asset.sh_degree > 0 {
            let ShBits { first, rest } = sh_bits;
            log.detail(&format!(
                "{}: SH in {first} bits (degree 1) and {rest} bits (others)",
                path.display()
            ));
        }
        Ok(SpzOptions { sh_bits, ..options })
    }

    fn write_one(
        &self,
        asset: &SplatAsset,
        path: &Path,
        (rounding, spz): (Rounding, SpzOptions),
        verification: Option<&mut Verification<'_>>,
    ) -> Result<Exported> {
        let &Self { args, log, .. } = self;
        if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        }
        if args.quality.is_some() && Format::of(path)? == Format::Ply {
            let what = "this format has a single quality: --quality does not apply";
            log.warn("quality-not-applied", &format!("{}: {what}", path.display()), 1);
        }
        let Rounding { quality, steps, .. } = rounding;
        let options = WriteOptions {
            quality,
            mesh: args.mesh,
            steps,
            per_splat: rounding.per_splat(),
            cameras: args.cameras(),
            ply_up: args.up.unwrap_or_default().ply,
            spz,
        };
        let staged = stage_asset(path, rounding.adapted.as_ref().unwrap_or(asset), &options)?;
        for note in &staged.written().notes {
            log.warn("export", &format!("{}: {note}", path.display()), 1);
        }
        let limits = args.rate_goal().own_limits().filter(|_| Format::from_path(path) == Some(Format::Ltgs));
        let verified = verification.map(|with| verify_staged(with, &staged.path(), limits)).transpose()?;
        let (verdict, on_test_photos) = verified.unzip();
        // A file that failed replaces nothing.
        let is_right = verdict.as_ref().is_none_or(|v| v.failures.is_empty());
        let written = if is_right { staged.publish(args.force)? } else { staged.written().clone() };
        let on_test_photos = on_test_photos.flatten();
        let loses_textures = asset.num_texels() > 0 && !Format::of(path)?.keeps_textures();
        let (path, raw_bytes) = (path.to_owned(), raw_bytes(asset));
        Ok(Exported { path, written, raw_bytes, verdict, on_test_photos, loses_textures })
    }
}

/// Reads a file back and compares its images with the scene's, and with the photos of test views if they are there.
fn verify_staged(
    with: &mut Verification<'_>,
    path: &Path,
    limits: Option<QualityLimits>,
) -> Result<(Verdict, Option<PhotoPsnr>)> {
    let contents = read_asset(path, &read_limits())?;
    let limits = limits.unwrap_or_else(|| QualityLimits::of_file(path, &contents));
    let fallback = read_fallback(path, &read_limits())?;
    let textured = Format::of(path)?.keeps_textures();
    let file = ReadBack { asset: &contents.asset, textured, fallback: fallback.as_ref() };
    let verdict = verify(&mut with.renderer, &with.expected, file, None, limits)?;
    let Some((expected, photos)) = &with.tests else { return Ok((verdict, None)) };
    let on_tests = verify(&mut with.renderer, expected, file, Some(*photos), QualityLimits::NONE)?;
    Ok((verdict, on_tests.on_test_photos))
}

/// Bytes of the numbers of a scene as f32 and u16.
fn raw_bytes(asset: &SplatAsset) -> u64 {
    let per_splat = 4 * (3 + 4 + 2 + 1 + 1) + 4;
    let sh: usize = asset.sh_degrees.iter().map(|&degree| 3 * num_sh_coefficients(degree.into())).sum();
    (asset.num_splats() * per_splat + 4 * (sh + asset.texels.len())) as u64
}

impl Exports {
    /// What the comparison of each file with the scene found.
    ///
    /// # Errors
    /// What stopped the writing, else [`Error::CheckFailed`] if a file failed verification.
    pub fn figures(self) -> Result<Vec<FileFigures>> {
        let failures: Vec<String> = self.files.iter().flat_map(Exported::failures).collect();
        let failed = (!failures.is_empty()).then(|| Error::CheckFailed(failures.join("; ")));
        if let Some(error) = self.stopped.or(failed) {
            return Err(error);
        }
        let figures = self.files.iter().filter_map(|file| {
            let verdict = (file.verdict.as_ref()?, file.on_test_photos);
            Some(FileFigures::new(&file.path, file.written.scene_bytes(), verdict, file.loses_textures))
        });
        Ok(figures.collect())
    }

    /// A row for each file, those beside the ones asked for included. The ratio is that of all files of a scene. It fails with what
    /// stopped the writing, else if a file failed verification.
    pub fn output(self) -> Output {
        let headings = ["file", "size", "ratio", "PSNR to scene", "lost", "test PSNR", "verified"];
        let rows: Vec<Vec<String>> = self.files.iter().flat_map(Exported::rows).collect();
        let mut text = columns(&headings, &rows);
        if self.files.iter().any(|f| f.verdict.as_ref().is_some_and(|v| v.untextured)) {
            text += "* against the untextured scene: this format has no textures, maps are averaged into the colours\n";
        }
        self.files.iter().filter_map(Exported::lost_textures).for_each(|line| text += &line);
        let failures: Vec<String> = self.files.iter().flat_map(Exported::failures).collect();
        let failed = (!failures.is_empty()).then(|| Error::CheckFailed(failures.join("; ")));
        let files: Vec<Value> = self.files.iter().map(Exported::json).collect();
        Output::new("litetex-export/1", json!({ "files": files }), text).failing(self.stopped.or(failed))
    }
}

impl Exported {
    fn failures(&self) -> impl Iterator<Item = String> {
        let all = self.verdict.iter().flat_map(|v| &v.failures);
        all.map(|f| format!("{}: not written, verification failed: {f}", self.path.display()))
    }

    fn json(&self) -> Value {
        let each =
            self.written.each().map(|(file, bytes)| json!({ "path": path_text(file), "bytes": bytes }));
        json!({
            "path": path_text(&self.path),
            "files": each.collect::<Vec<_>>(),
            "raw_bytes": self.raw_bytes,
            "verdict": self.verdict,
            "on_test_photos": self.on_test_photos,
            "lost_textures": self.loses_textures.then(|| json!({
                "psnr_to_textured": self.verdict.as_ref().map(|v| v.fallback_psnr),
                "loss_db": self.verdict.as_ref().map(|v| v.fallback_loss_db),
                "train_instead": TRAIN_INSTEAD,
            })),
        })
    }

    /// What the scene's textures were good for, and how to train without them, as a line; `None` where none are lost.
    fn lost_textures(&self) -> Option<String> {
        self.loses_textures.then(|| {
            let lost = self.verdict.as_ref().map_or_else(
                || "the textures are lost".to_owned(),
                |v| {
                    let (psnr, loss) = (v.fallback_psnr, v.fallback_loss_db);
                    format!("{psnr:.2} dB against the textured scene, {loss:.2} dB lost with the textures")
                },
            );
            format!("{}: {lost}; train scenes for this format with: {TRAIN_INSTEAD}\n", self.path.display())
        })
    }

    /// A row for the file that was asked for, which tells of the scene, and one with the size of each file beside it.
    fn rows(&self) -> Vec<Vec<String>> {
        let cell = |of: &dyn Fn(&Verdict) -> String| self.verdict.as_ref().map_or_else(|| "-".to_owned(), of);
        let of_scene = [
            format!("{:.1}", self.raw_bytes as f64 / self.written.scene_bytes().max(1) as f64),
            cell(&|v| match v.largest {
                0.0 => "same".to_owned(),
                _ => format!("{:.1} dB{}", v.psnr, if v.untextured { " *" } else { "" }),
            }),
            cell(&|v| if v.untextured { "textures".to_owned() } else { format!("{:.3} dB", v.loss_db) }),
            self.on_test_photos.map_or_else(
                || "-".to_owned(),
                |PhotoPsnr { before, after, .. }| format!("{before:.2} -> {after:.2} dB"),
            ),
            cell(&|v| if v.failures.is_empty() { "yes".to_owned() } else { "NO".to_owned() }),
        ];
        let beside = std::array::from_fn(|_| "-".to_owned());
        let of_file = |(i, (file, bytes)): (usize, (&Path, u64))| {
            let cells = if i == 0 { &of_scene } else { &beside };
            [file.display().to_string(), format_bytes(bytes)]
                .into_iter()
                .chain(cells.iter().cloned())
                .collect()
        };
        self.written.each().enumerate().map(of_file).collect()
    }
}
