//! `litetex capture` with stand-ins for the programs that it starts, which record their arguments, and once with real ones.

#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "tests")]

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use tempfile::TempDir;

/// A model of one camera and as many photos as its first words say, as the stand-ins write it.
const MODEL: &str = r#"
mkdir -p "$out/0" "$out/1"
printf '\002\000\000\000\000\000\000\000' > "$out/0/images.bin"
printf '\003\000\000\000\000\000\000\000' > "$out/1/images.bin"
"#;

/// Keeps its arguments; `fail-STEP` beside it makes a step fail.
const COLMAP: &str = r#"
printf '%s\n' "$*" >> "$HERE/calls"
[ "$1" = help ] && { echo "COLMAP $(cat "$HERE/version") -- Structure-from-Motion"; exit 0; }
[ -e "$HERE/fail-$1" ] && { echo "no luck with $1"; exit 7; }
[ -e "$HERE/wait-$1" ] && sleep 60
while [ $# -gt 0 ]; do
  [ "$1" = --output_path ] && out="$2"
  [ "$1" = --database_path ] && echo features > "$2"
  shift
done
[ -n "$out" ] || exit 0
"#;

/// Answers as Python with pycolmap does.
const PYTHON: &str = r#"
printf '%s\n' "$*" >> "$HERE/calls"
[ "$1" = -c ] && { echo "pycolmap $(cat "$HERE/version")"; exit 0; }
cat "$3" > "$HERE/$2.json"
[ -e "$HERE/fail-$2" ] && { echo "Traceback: no luck"; exit 7; }
value() { sed -n "s/.*\"$1\": \"\(.*\)\".*/\1/p" "$3" | head -1; }
case "$2" in
  features) echo features > "$(value database x "$3")"; echo "Processed file [1/3]" >&2;;
  mapping) out="$(value models x "$3")";;
esac
[ -n "$out" ] || exit 0
"#;

const FFPROBE: &str = r#"
printf 'ffprobe %s\n' "$*" >> "$HERE/calls"
cat "$HERE/probe"
"#;

/// 30 grey frames of 64 x 48, of which those after each third have detail; then the files asked for.
const FFMPEG: &str = r#"
printf 'ffmpeg %s\n' "$*" >> "$HERE/calls"
case "$*" in
  *-version*) echo "ffmpeg version $(cat "$HERE/ffmpeg-version") Copyright"; exit 0;;
  *-filters*) cat "$HERE/filters"; exit 0;;
  *pipe:1) exec python3 -c '
import sys
for n in range(30):
    sys.stdout.buffer.write(bytes((255 if n % 3 == 1 else 90) * ((x // 2 + y // 2) % 2) for y in range(48) for x in range(64)))';;
esac
for last; do :; done
n=$(cat "$HERE/frames")
i=1
while [ $i -le $n ]; do printf jpeg > "$(dirname "$last")/$(printf %05d $i).jpg"; i=$((i + 1)); done
"#;

struct Place(TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        fs::create_dir(place.path("bin")).unwrap();
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    /// Puts a stand-in on the PATH.
    fn program(self, name: &str, text: &str) -> Self {
        let here = self.0.path().display();
        let model = if text.contains("$out") { MODEL } else { "" };
        let file = self.path("bin").join(name);
        fs::write(
            &file,
            format!("#!/bin/sh\nHERE='{here}'\nPATH=/usr/local/bin:/usr/bin:/bin\n{text}{model}"),
        )
        .unwrap();
        fs::set_permissions(&file, fs::Permissions::from_mode(0o755)).unwrap();
        self
    }

    fn colmap(self, version: &str) -> Self {
        self.write("version", version);
        self.program("colmap", COLMAP)
    }

    fn ffmpeg(self, probe: &str, filters: &str) -> Self {
        self.write("probe", probe);
        self.write("filters", filters);
        self.write("ffmpeg-version", "5.1.9");
        self.write("frames", "10");
        self.program("ffprobe", FFPROBE).program("ffmpeg", FFMPEG)
    }

    /// Three photos with blanks in their names, one of another size.
    fn photos(self) -> Self {
        let folder = self.path("my photos");
        fs::create_dir(&folder).unwrap();
        for (name, side) in [("a 1.png", 40), ("b.png", 40), ("c#.jpg", 32)] {
            image::RgbImage::new(side, 30).save(folder.join(name)).unwrap();
        }
        self
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin("litetex"));
        command
            .current_dir(self.0.path())
            .args(arguments)
            .env("PATH", self.path("bin"))
            .env_remove("LITETEX_PYTHON");
        command
    }

    /// Exit code, and all that was printed.
    fn run(&self, arguments: &[&str]) -> (i32, String) {
        let output = self.command(arguments).output().unwrap();
        let text = [output.stdout, output.stderr].concat();
        (output.status.code().unwrap_or(-1), String::from_utf8(text).unwrap())
    }

    fn calls(&self) -> String {
        fs::read_to_string(self.path("calls")).unwrap_or_default()
    }

    /// How often a program was called with this argument.
    fn count(&self, argument: &str) -> usize {
        self.calls().lines().filter(|line| line.contains(argument)).count()
    }
}

const PHOTOS: [&str; 4] = ["capture", "my photos", "-o", "out folder"];

fn names(folder: &Path) -> Vec<String> {
    let mut all: Vec<_> =
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    all.sort();
    all
}

/// The capture is whole, with the larger of both models.
fn assert_made(place: &Place, text: &str) {
    let out = place.path("out folder");
    assert_eq!(names(&out), ["images", "sparse"], "{text}");
    assert_eq!(names(&out.join("sparse")), ["0"]);
    assert_eq!(fs::read(out.join("sparse/0/images.bin")).unwrap()[0], 3);
    assert!(text.contains("have poses"), "{text}");
    let next = text.split_once("next: ").map(|(_, next)| next.lines().next().unwrap());
    assert!(next.is_none_or(|next| next == "litetex train 'out folder' -o RUN"), "{text}");
}

#[test]
fn colmap_gets_the_options_of_its_version() {
    for (version, renamed) in [("3.8", false), ("3.12.6", false), ("3.13.0", true), ("4.0.1", true)] {
        let place = Place::new().colmap(version).photos();
        let (code, text) = place.run(&PHOTOS);
        assert_eq!(code, 0, "{text}");
        assert_made(&place, &text);
        assert_eq!(names(&place.path("out folder/images")), ["a_1.png", "b.png", "c_.jpg"]);
        let calls = place.calls();
        let (old, new) =
            (calls.contains("--SiftExtraction.use_gpu 0"), calls.contains("--FeatureExtraction.use_gpu 0"));
        assert_eq!((old, new), (!renamed, renamed), "{version}: {calls}");
        assert_eq!(calls.contains("--SiftExtraction.max_image_size 1200"), !renamed);
        assert_eq!(calls.contains("--FeatureMatching.use_gpu 0"), renamed);
        assert!(calls.contains("--SiftExtraction.max_num_features 3000"));
        // Two sizes are two cameras, each with its own list.
        assert_eq!(place.count("feature_extractor"), 2);
        assert!(text.contains("3 of 3 photos have poses (100 %)") && text.contains("takes about"), "{text}");
    }
    let place = Place::new().colmap("3.7").photos();
    let (code, text) = place.run(&PHOTOS);
    assert!(code == 5 && text.contains("COLMAP 3.7") && text.contains("expected 3.8"), "{text}");
}

#[test]
fn pycolmap_is_preferred_and_an_old_one_is_not_used() {
    let place = Place::new().colmap("4.2.1").program("python3", PYTHON).photos();
    let (code, text) = place.run(&[&PHOTOS[..], &["--poses", "full", "--threads", "1"]].concat());
    assert_eq!(code, 0, "{text}");
    assert_made(&place, &text);
    assert_eq!(place.count("feature_extractor"), 0, "{}", place.calls());
    let job: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(place.path("features.json")).unwrap()).unwrap();
    assert_eq!((&job["side_max_px"], &job["features_max"]), (&3200.into(), &8192.into()));
    assert_eq!(job["cameras"].as_array().unwrap().len(), 2);
    let place = Place::new().colmap("3.8").program("python3", PYTHON).photos();
    let (code, text) = place.run(&PHOTOS);
    assert!(code == 0 && place.count("feature_extractor") == 2, "{text}");
}

#[test]
fn a_step_that_fails_is_named_with_its_log_and_the_next_run_goes_on_from_there() {
    let place = Place::new().colmap("4.0").photos();
    place.write("fail-mapper", "");
    let (code, text) = place.run(&PHOTOS);
    assert!(code == 5 && text.contains("no luck with mapper") && text.contains("logs/mapping.txt"), "{text}");
    assert_eq!(names(&place.path("out folder")), [".capture-work"], "nothing half-written");
    fs::remove_file(place.path("fail-mapper")).unwrap();
    let (code, text) = place.run(&PHOTOS);
    assert_eq!(code, 0, "{text}");
    assert_made(&place, &text);
    let counts = ["feature_extractor", "matches_importer", "mapper"].map(|step| place.count(step));
    assert_eq!(counts, [2, 1, 2]);
    for (out, words) in
        [("out folder", "holds a capture already"), ("bin", "is not empty"), ("calls", "is a file")]
    {
        let (code, text) = place.run(&["capture", "my photos", "-o", out]);
        assert!(code == 2 && text.contains(words), "{text}");
        assert!(!text.contains("takes about"), "no estimate of what is not done: {text}");
    }
}

/// Kills a run while it matches pairs. The next run meets a lock as long as the first lives.
fn killed_while_matching() -> Place {
    let place = Place::new().colmap("4.0").photos();
    place.write("wait-matches_importer", "");
    let mut child = place.command(&PHOTOS).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    for _ in 0..300 {
        if place.count("matches_importer") > 0 {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    let (code, text) = place.run(&PHOTOS);
    assert!(code == 2 && text.contains("another"), "{text}");
    child.kill().unwrap();
    child.wait().unwrap();
    fs::remove_file(place.path("wait-matches_importer")).unwrap();
    place
}

#[test]
fn a_run_that_was_killed_goes_on_and_other_settings_begin_anew() {
    let all = ["feature_extractor", "matches_importer", "mapper"];
    // Features are found, so the same settings repeat the matching only, into the database that is there.
    let place = killed_while_matching();
    assert_eq!(all.map(|step| place.count(step)), [2, 1, 0]);
    let copied = place.path("out folder/.capture-work/images/b.png");
    let written = fs::metadata(&copied).unwrap().modified().unwrap();
    fs::write(place.path("out folder/.capture-work/database.db"), "half of the matches").unwrap();
    place.write("wait-mapper", "");
    let mut child = place.command(&PHOTOS).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    for _ in 0..300 {
        if place.count("mapper") > 0 {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    fs::remove_file(place.path("wait-mapper")).unwrap();
    assert_eq!(all.map(|step| place.count(step)), [2, 2, 1], "features are not found again");
    assert_eq!(fs::metadata(&copied).unwrap().modified().unwrap(), written, "photos are not copied again");
    let (code, text) = place.run(&PHOTOS);
    assert_eq!(code, 0, "{text}");
    assert_made(&place, &text);
    assert_eq!(all.map(|step| place.count(step)), [2, 2, 2], "nor are pairs matched again");
    // Negative control: other settings need other features, and all that follows.
    let place = killed_while_matching();
    let (code, text) = place.run(&[&PHOTOS[..], &["--poses", "full"]].concat());
    assert_eq!(code, 0, "{text}");
    assert_made(&place, &text);
    assert_eq!(all.map(|step| place.count(step)), [4, 2, 1]);
}

#[test]
fn missing_programs_are_named_with_what_to_install_and_print_shows_the_commands() {
    let place = Place::new().photos();
    let (code, text) = place.run(&PHOTOS);
    assert!(
        code == 5 && text.contains("pip install pycolmap") && text.contains("cp 'my photos/a 1.png'"),
        "{text}"
    );
    let (code, text) = place.run(&[&PHOTOS[..], &["--print"]].concat());
    assert_eq!(code, 0, "{text}");
    for words in ["feature_extractor", "matches_importer", "mapper", "litetex train 'out folder' -o RUN"] {
        assert!(text.contains(words), "{words}: {text}");
    }
    assert!(!text.contains("ImageMagick"), "no photo is turned: {text}");
    image::RgbImage::new(40, 30).save(place.path("my photos/t.tif")).unwrap();
    let (_, text) = place.run(&[&PHOTOS[..], &["--print"]].concat());
    assert!(text.contains("# ImageMagick, which turns") && text.contains("-auto-orient"), "{text}");
    let place = place.program("convert", "");
    let (_, text) = place.run(&[&PHOTOS[..], &["--print"]].concat());
    let convert = format!("{} 'my photos/t.tif' -auto-orient", place.path("bin/convert").display());
    assert!(text.contains(&convert) && !text.contains("# ImageMagick"), "{text}");
    place.write("clip.mp4", "");
    let (code, text) = place.run(&["capture", "clip.mp4", "-o", "v"]);
    assert!(code == 5 && text.contains("ffmpeg, which reads videos, is missing. Install it:"), "{text}");
    // What does not serve comes first.
    let place = place.program("other", "");
    for (name, wrong) in [("bin/none", "no such program"), ("bin/other", "does not answer as COLMAP does")] {
        let program = place.path(name);
        let (code, text) =
            place.run(&["capture", "my photos", "-o", "v", "--colmap", program.to_str().unwrap()]);
        let first = format!("error[device]: --colmap {}: {wrong}; ", program.display());
        assert!(code == 5 && text.starts_with(&first), "{text}");
        assert!(text.contains("\npycolmap 4 or COLMAP 3.8, which finds the poses, is missing."), "{text}");
    }
    fs::write(place.path("my photos/d.heic"), "x").unwrap();
    let (code, text) = place.run(&PHOTOS);
    assert!(code == 3 && text.contains("d.heic"), "{text}");
    assert!(!place.path("out folder").exists(), "nothing half-written");
}

/// Runs what `--print` prints, and says how `litetex train` would be called.
fn run_printed(place: &Place, arguments: &[&str]) -> String {
    let (code, text) = place.run(&[arguments, &["--print"]].concat());
    assert_eq!(code, 0, "{text}");
    place.write("calls", "");
    let path = format!("{}:/usr/bin:/bin", place.path("bin").display());
    let mut shell = Command::new("sh");
    let output = shell.args(["-euc", &text]).current_dir(place.0.path()).env("PATH", path).output().unwrap();
    assert!(output.status.success(), "{}\n{text}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(fs::read(place.path("out folder/sparse/0/images.bin")).unwrap()[0], 3, "the larger model");
    fs::read_to_string(place.path("trained")).unwrap()
}

#[test]
fn printed_commands_make_the_same_capture() {
    const TRAIN: &str = "printf '%s|' \"$@\" > \"$HERE/trained\"\n";
    let probe = r#"{"streams":[{"width":64,"height":48,"avg_frame_rate":"30/1","duration":"1.0"}]}"#;
    let lines = |place: &Place, name: &str| {
        fs::read_to_string(place.path("out folder").join(name)).unwrap().lines().count()
    };
    for python in [false, true] {
        let job = |place: &Place| -> serde_json::Value {
            serde_json::from_str(&fs::read_to_string(place.path("features.json")).unwrap()).unwrap()
        };
        let steps = |place: &Place| {
            let names = if python {
                ["py features", "py matching", "py mapping"]
            } else {
                ["feature_extractor", "matches_importer", "mapper"]
            };
            names.map(|name| place.count(name))
        };
        let engine = |place: Place| match python {
            true => {
                place.write("version", "4.2.1");
                place.program("python3", PYTHON)
            }
            false => place.colmap("3.8"),
        };
        let place = engine(Place::new().program("litetex", TRAIN)).photos();
        fs::create_dir(place.path("my photos/inner")).unwrap();
        image::RgbImage::new(40, 30).save(place.path("my photos/inner/d.png")).unwrap();
        assert_eq!(run_printed(&place, &PHOTOS), "train|out folder|-o|RUN|");
        // Two sizes are two cameras: COLMAP is called for each.
        assert_eq!(steps(&place), [if python { 1 } else { 2 }, 1, 1], "{}", place.calls());
        assert_eq!((lines(&place, "names.txt"), lines(&place, "pairs.txt")), (4, 6));

        let place = engine(Place::new().program("litetex", TRAIN).ffmpeg(probe, ""));
        place.write("my clip.mp4", "");
        place.write("frames", "25");
        assert_eq!(
            run_printed(&place, &["capture", "my clip.mp4", "-o", "out folder"]),
            "train|out folder|-o|RUN|"
        );
        assert_eq!(steps(&place), [1, 1, 1], "{}", place.calls());
        // Each of 25 frames with the 10 that follow, and the first with the 21st, a tenth.
        assert_eq!((lines(&place, "names.txt"), lines(&place, "pairs.txt")), (25, 25 * 10 - 55 + 1));
        if python {
            assert_eq!(job(&place)["cameras"], serde_json::json!([{ "parameters": "", "names": [] }]));
        } else {
            assert_eq!(lines(&place, "camera-0.txt"), 25);
        }
    }
}

#[test]
fn of_a_video_the_sharp_frames_are_taken_in_order() {
    let probe = r#"{"streams":[{"width":64,"height":48,"avg_frame_rate":"30/1","duration":"1.0"EXTRA}]}"#;
    let place = Place::new().colmap("4.0").ffmpeg(&probe.replace("EXTRA", ""), "");
    place.write("my clip.mp4", "");
    let arguments = ["capture", "my clip.mp4", "-o", "out folder"];
    let (code, text) = place.run(&arguments);
    assert_eq!(code, 0, "{text}");
    assert_made(&place, &text);
    let taken: Vec<String> = (0..10).map(|n| format!("frame_{:05}.jpg", 3 * n + 1)).collect();
    assert_eq!(names(&place.path("out folder/images")), taken);
    let calls = place.calls();
    assert!(calls.contains(r"(eq(n\,1)+eq(n\,4))+") && calls.contains("-fps_mode passthrough"), "{calls}");
    assert!(text.contains("3 of 10 photos have poses (30 %): try --poses full"), "{text}");

    // ffmpeg writes fewer than it was asked for.
    let place = Place::new().colmap("4.0").ffmpeg(&probe.replace("EXTRA", ""), "");
    place.write("my clip.mp4", "");
    place.write("frames", "9");
    place.write("ffmpeg-version", "4.4");
    let (code, text) = place.run(&arguments);
    assert!(code == 3 && text.contains("9 of 10 frames"), "{text}");
    assert!(place.calls().contains("-vsync passthrough") && !place.path("out folder/images").exists());

    let hdr = probe.replace("EXTRA", r#","color_transfer":"arib-std-b67""#);
    for (filters, expected) in [("zscale tonemap", 0), ("scale", 4)] {
        let place = Place::new().colmap("4.0").ffmpeg(&hdr, filters);
        place.write("my clip.mp4", "");
        let (code, text) = place.run(&arguments);
        assert_eq!(code, expected, "{text}");
        assert!(text.contains("HDR") && place.calls().contains("tonemap=") == (expected == 0), "{text}");
    }
}

#[test]
fn photos_are_written_upright_and_half_decoded_heic_is_refused() {
    let convert = "printf '%s\\n' \"$*\" >> \"$HERE/calls\"\ncp \"$HERE/decoded.png\" \"$2\"\n";
    let place = Place::new().colmap("4.0").program("heif-convert", convert).photos();
    image::RgbImage::from_fn(40, 30, |x, _| image::Rgb([if x < 20 { 255 } else { 0 }; 3]))
        .save(place.path("my photos/t.tif"))
        .unwrap();
    let (code, text) = place.run(&PHOTOS);
    assert_eq!(code, 0, "{text}");
    let tiff = image::open(place.path("out folder/images/t.jpg")).unwrap().into_rgb8();
    assert!(tiff.dimensions() == (40, 30) && tiff.get_pixel(5, 5)[0] > 240 && tiff.get_pixel(35, 5)[0] < 15);
    // A file of 4032 x 3024 without pixels; the stand-in decodes one tile of it.
    let place = Place::new().colmap("4.0").program("heif-convert", convert).photos();
    fs::write(place.path("my photos/h.HEIC"), heic()).unwrap();
    for (size, expected) in [((512, 512), 4), ((64, 48), 0)] {
        image::RgbImage::new(size.0, size.1).save(place.path("decoded.png")).unwrap();
        let (code, text) = place.run(&PHOTOS);
        assert_eq!(code, expected, "{text}");
        assert!(expected == 0 || text.contains("512 x 512 px of a photo of 64 x 48"), "{text}");
    }
    assert!(place.path("out folder/images/h.jpg").exists());
    // Where a file holds several images, the programs number what they write.
    let several =
        "cp \"$HERE/decoded.png\" \"${2%.png}-2.png\"\ncp \"$HERE/other.png\" \"${2%.png}-1.png\"\n";
    let place = Place::new().colmap("4.0").program("heif-convert", several).photos();
    fs::write(place.path("my photos/h.HEIC"), heic()).unwrap();
    image::RgbImage::from_pixel(64, 48, image::Rgb([250; 3])).save(place.path("decoded.png")).unwrap();
    image::RgbImage::new(40, 30).save(place.path("other.png")).unwrap();
    let (code, text) = place.run(&PHOTOS);
    assert_eq!(code, 0, "{text}");
    let taken = image::open(place.path("out folder/images/h.jpg")).unwrap().into_rgb8();
    assert!(taken.dimensions() == (64, 48) && taken.get_pixel(9, 9)[0] > 240);
    assert!(!place.path("out folder/images/h.decoded").exists());
}

/// A HEIC file of 64 x 48 pixels, none of which it holds.
fn heic() -> Vec<u8> {
    let boxed =
        |kind: &[u8], content: &[u8]| [&(content.len() as u32 + 8).to_be_bytes()[..], kind, content].concat();
    let size = [&[0; 4][..], &64_u32.to_be_bytes(), &48_u32.to_be_bytes()].concat();
    let links = [0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 1, 1];
    let known = boxed(b"ipco", &boxed(b"ispe", &size));
    let properties = boxed(b"iprp", &[known, boxed(b"ipma", &links)].concat());
    let meta = [&[0; 4][..], &boxed(b"pitm", &[0, 0, 0, 0, 0, 1]), &properties].concat();
    [boxed(b"ftyp", b"heic\0\0\0\0mif1"), boxed(b"meta", &meta)].concat()
}

/// The real programs: 40 frames of 320 x 240.
#[test]
fn a_made_video_becomes_a_capture() {
    let python = std::env::var("LITETEX_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let works = |program: &str, arguments: &[&str]| {
        Command::new(program).args(arguments).output().is_ok_and(|o| o.status.success())
    };
    if !works("ffmpeg", &["-version"])
        || !works(&python, &["-c", "import pycolmap; assert pycolmap.__version__ >= '4'"])
    {
        println!("skipped: needs ffmpeg, and pycolmap 4 in python3 or the Python that LITETEX_PYTHON names");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin("litetex"));
        let output = command.current_dir(folder.path()).args(arguments).output().unwrap();
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()
    };
    run(&["sample", "video", "--video", "120", "--size", "320x240", "--json"]);
    let made =
        run(&["capture", "video/video.avi", "-o", "c", "--frames", "40", "--python", &python, "--json"]);
    assert_eq!((&made["photos"], &made["frames_looked_at"]), (&40.into(), &120.into()));
    assert!(made["registered"].as_u64().unwrap() >= 36, "{made}");
    let number = |name: &String| name["frame_".len().."frame_00000".len()].parse::<usize>().unwrap();
    let photos = names(&folder.path().join("c/images"));
    assert!(photos.iter().all(|name| number(name) % 3 == 1), "no blurred frame: {photos:?}");
    let found = run(&["inspect", "c", "--json"]);
    assert_eq!(found["views"], made["registered"]);
}
