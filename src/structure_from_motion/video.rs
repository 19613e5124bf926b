//! Videos: what ffprobe says of one, and how ffmpeg makes frames of it.

use super::child::{Command, Observer};
use super::frames::{self, Detail};
use super::tools::Ffmpeg;
use crate::Result;
use serde_json::Value;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Frames of a second that are looked at.
const RATE_MAX: f64 = 30.0;

/// Frames that are looked at in all; of long videos fewer of a second.
const LOOKED_AT_MAX: f64 = 9000.0;

/// The longer side at which sharpness is measured, pixels: blur over 4 px of 1,920 is more than a pixel then.
const LOOKED_AT_SIDE_PX: u32 = 640;

/// From this version on, ffmpeg has `-fps_mode` in place of `-vsync`.
const FPS_MODE: (u32, u32) = (5, 1);

/// Peak of the light that tone mapping takes for white, cd/m2.
const TONE_MAP: &str = "zscale=t=linear:npl=203,format=gbrpf32le,zscale=p=bt709,tonemap=mobius:desat=0,\
                        zscale=t=bt709:m=bt709:r=tv,format=yuv420p";

/// What a video is.
#[derive(Clone, Debug, PartialEq)]
pub struct Video {
    file: PathBuf,
    /// As shown: turned, with square pixels.
    pub size: (u32, u32),
    /// Frames a second that are looked at, as ffmpeg reads it.
    rate: String,
    rate_hz: f64,
    pub duration_secs: f64,
    hdr: Option<&'static str>,
    has_wide_pixels: bool,
    is_interlaced: bool,
}

impl Video {
    /// Asks ffprobe.
    ///
    /// # Errors
    /// [`crate::Error::InvalidInput`] if it finds no video,
    /// [`crate::Error::Unsupported`] for one that cannot be shown in 8 bits.
    pub fn look(file: &Path, ffmpeg: &Ffmpeg) -> Result<Self> {
        let probe = Command::new(&ffmpeg.ffprobe)
            .option("-v", "error")
            .option("-select_streams", "v:0")
            .args(["-show_streams", "-show_format"])
            .option("-of", "json")
            .arg(file);
        let broken = || {
            invalid!(
                file,
                "ffprobe finds no video in it; play it to check, and copy it from the camera again"
            )
        };
        let answer = probe.answer().ok_or_else(broken)?;
        let found: Value = serde_json::from_str(&answer).map_err(|_| broken())?;
        let video = Self::from_probe(file, &found).ok_or_else(broken)?;
        if found["streams"][0]["side_data_list"]
            .as_array()
            .is_some_and(|all| all.iter().any(|d| d["dv_profile"] == 5))
        {
            return Err(unsupported!(
                file,
                "Dolby Vision profile 5, whose colours no other decoder knows; record or export it as SDR or HLG"
            ));
        }
        let can_map = || {
            let filters =
                Command::new(&ffmpeg.ffmpeg).args(["-v", "error", "-filters"]).answer().unwrap_or_default();
            ["zscale", "tonemap"].iter().all(|name| filters.split_whitespace().any(|word| word == *name))
        };
        match video.hdr {
            Some(kind) if !can_map() => Err(unsupported!(
                file,
                "an HDR video ({kind}), and this ffmpeg cannot map it to SDR: it lacks the filters zscale or tonemap. \
                 Install an ffmpeg that was built with libzimg, or record in SDR"
            )),
            _ => Ok(video),
        }
    }

    fn from_probe(file: &Path, found: &Value) -> Option<Self> {
        let stream = found["streams"].get(0)?;
        let number = |value: &Value| value.as_f64().or_else(|| value.as_str()?.parse().ok());
        let ratio = |value: &Value, mark: char| -> Option<f64> {
            let (over, under) = value.as_str()?.split_once(mark)?;
            let ratio = over.parse::<f64>().ok()? / under.parse::<f64>().ok()?;
            (ratio.is_finite() && ratio > 0.0).then_some(ratio)
        };
        let [width, height] =
            ["width", "height"].map(|side| stream[side].as_u64().filter(|px| (16..=16_384).contains(px)));
        let (width, height) = (width?, height?);
        let pixel = ratio(&stream["sample_aspect_ratio"], ':').unwrap_or(1.0);
        let wide = (width as f64 * pixel / 2.0).round() as u32 * 2;
        let has_wide_pixels = (pixel - 1.0).abs() > 1e-3;
        let width = if has_wide_pixels { wide } else { width as u32 };
        let sides = stream["side_data_list"].as_array().into_iter().flatten();
        let turn = sides
            .filter_map(|side| number(&side["rotation"]))
            .next()
            .or_else(|| number(&stream["tags"]["rotate"]));
        let is_turned = turn.is_some_and(|degrees| (degrees.abs() / 90.0).round() as i64 % 2 == 1);
        let size = if is_turned { (height as u32, width) } else { (width, height as u32) };
        let duration_secs =
            [&stream["duration"], &found["format"]["duration"]].into_iter().find_map(number)?;
        if !(duration_secs.is_finite() && duration_secs > 0.0) {
            return None;
        }
        let own = ratio(&stream["avg_frame_rate"], '/').or_else(|| ratio(&stream["r_frame_rate"], '/'))?;
        let most = RATE_MAX.min(LOOKED_AT_MAX / duration_secs);
        // The video's own rate where it may be kept: no frame is doubled or dropped then.
        let (rate, rate_hz) = match stream["avg_frame_rate"].as_str() {
            Some(text) if own <= most + 0.01 => (text.to_owned(), own),
            _ => (format!("{:.4}", own.min(most)), own.min(most)),
        };
        let hdr = match stream["color_transfer"].as_str() {
            Some("smpte2084") => Some("PQ"),
            Some("arib-std-b67") => Some("HLG"),
            _ => None,
        };
        let is_interlaced =
            stream["field_order"].as_str().is_some_and(|o| ["tt", "bb", "tb", "bt"].contains(&o));
        let file = file.to_owned();
        Some(Self { file, size, rate, rate_hz, duration_secs, hdr, has_wide_pixels, is_interlaced })
    }

    /// Frames that are looked at, about.
    pub fn frames(&self) -> usize {
        (self.duration_secs * self.rate_hz).round().max(1.0) as usize
    }

    /// What is said of it.
    pub fn describe(&self) -> String {
        let hdr = self.hdr.map(|kind| format!(", HDR ({kind}), mapped to SDR")).unwrap_or_default();
        let duration = crate::text::format_duration(self.duration_secs);
        format!("a video of {duration}, {} x {} px{hdr}", self.size.0, self.size.1)
    }

    fn looked_at_size(&self) -> (u32, u32) {
        let (width, height) = self.size;
        let longer = width.max(height);
        let side = |px: u32| {
            (u64::from(px) * u64::from(longer.min(LOOKED_AT_SIDE_PX)) / u64::from(longer)).max(8) as u32
        };
        (side(width), side(height))
    }

    fn input(&self, ffmpeg: &Ffmpeg) -> Command {
        let command =
            Command::new(&ffmpeg.ffmpeg).arg("-nostdin").option("-v", "error").option("-i", &self.file);
        command.option("-map", "0:v:0")
    }

    /// The first filters, after which frames are numbered.
    fn numbered(&self) -> String {
        let deinterlace = if self.is_interlaced { "yadif," } else { "" };
        format!("{deinterlace}fps={}", self.rate)
    }

    /// Filters that give pixels their shape and colour.
    fn shaped(&self) -> String {
        let (width, height) = self.size;
        let mut filters = String::new();
        if self.has_wide_pixels {
            let _ = write!(filters, "scale={width}:{height},setsar=1,");
        }
        if self.hdr.is_some() {
            filters += TONE_MAP;
            filters += ",";
        }
        // JPEG files have the colour matrix of BT.601 in full range.
        filters + "scale=out_color_matrix=bt601:out_range=full,format=yuvj420p"
    }

    fn every_frame(&self, command: Command, ffmpeg: &Ffmpeg) -> Command {
        let name = if ffmpeg.version >= FPS_MODE { "-fps_mode" } else { "-vsync" };
        command.option(name, "passthrough")
    }

    /// The detail of each frame.
    ///
    /// # Errors
    /// As [`Command::run`]; [`crate::Error::InvalidInput`] if there is no frame.
    pub fn details(&self, ffmpeg: &Ffmpeg, log: &Path, observer: &dyn Observer) -> Result<Vec<Detail>> {
        let (width, height) = self.looked_at_size();
        let filters = format!("{},scale={width}:{height}:flags=area,format=gray", self.numbered());
        let command = self.every_frame(self.input(ffmpeg).option("-vf", filters), ffmpeg);
        let command = command.option("-f", "rawvideo").arg("pipe:1");
        let mut found = Vec::new();
        command.run_chunks(log, observer, width as usize * height as usize, |grey| {
            found.push(frames::detail(grey, width as usize));
            observer.progress(found.len(), self.frames().max(found.len()));
        })?;
        if found.is_empty() {
            return Err(invalid!(&self.file, "ffmpeg decodes no frame of it; see {}", log.display()));
        }
        Ok(found)
    }

    /// Writes these frames, in order, as `00001.jpg` and so on.
    pub fn extraction(&self, ffmpeg: &Ffmpeg, chosen: &[usize], folder: &Path) -> Command {
        let filters = format!("{},select={},{}", self.numbered(), any_of(chosen), self.shaped());
        let command = self.every_frame(self.input(ffmpeg).option("-vf", filters), ffmpeg);
        command.option("-q:v", "2").arg(folder.join("%05d.jpg"))
    }

    /// Writes about this many frames at even times.
    pub fn even_extraction(&self, ffmpeg: &Ffmpeg, count: usize, folder: &Path) -> Command {
        let filters = format!("fps={:.3},{}", count as f64 / self.duration_secs, self.shaped());
        self.input(ffmpeg).option("-vf", filters).option("-q:v", "2").arg(folder.join("frame_%05d.jpg"))
    }
}

/// An expression that is not zero for these frames. Sums of sums: ffmpeg allows expressions a depth of 100.
fn any_of(frames: &[usize]) -> String {
    match frames {
        [] => "0".to_owned(),
        [frame] => format!("eq(n\\,{frame})"),
        _ => {
            let (first, rest) = frames.split_at(frames.len() / 2);
            format!("({}+{})", any_of(first), any_of(rest))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn probe(change: Value) -> Option<Video> {
        let mut stream =
            json!({ "width": 1920, "height": 1080, "avg_frame_rate": "30000/1001", "duration": "10.0" });
        for (key, value) in change.as_object().unwrap() {
            stream[key] = value.clone();
        }
        Video::from_probe(Path::new("a.mov"), &json!({ "streams": [stream] }))
    }

    #[test]
    fn turned_wide_hdr_and_fast_videos_are_told_apart() {
        let plain = probe(json!({})).unwrap();
        assert_eq!((plain.size, plain.rate.as_str(), plain.frames()), ((1920, 1080), "30000/1001", 300));
        assert_eq!(plain.shaped(), "scale=out_color_matrix=bt601:out_range=full,format=yuvj420p");
        for change in
            [json!({ "side_data_list": [{ "rotation": -90 }] }), json!({ "tags": { "rotate": "270" } })]
        {
            assert_eq!(probe(change).unwrap().size, (1080, 1920));
        }
        assert_eq!(probe(json!({ "side_data_list": [{ "rotation": 180 }] })).unwrap().size, (1920, 1080));
        let wide = probe(json!({ "width": 1440, "sample_aspect_ratio": "4:3" })).unwrap();
        assert!(wide.size == (1920, 1080) && wide.shaped().starts_with("scale=1920:1080,setsar=1"));
        let hdr = probe(json!({ "color_transfer": "arib-std-b67" })).unwrap();
        assert!(hdr.shaped().contains("tonemap") && hdr.describe().contains("HLG"));
        let fast = probe(json!({ "avg_frame_rate": "240/1" })).unwrap();
        assert_eq!((fast.rate.as_str(), fast.frames()), ("30.0000", 300));
        let long = probe(json!({ "duration": "3600" })).unwrap();
        assert_eq!((long.rate.as_str(), long.frames()), ("2.5000", 9000));
        assert!(probe(json!({ "field_order": "tt" })).unwrap().numbered().starts_with("yadif"));
        for broken in
            [json!({ "width": 0 }), json!({ "duration": "N/A" }), json!({ "avg_frame_rate": "0/0" })]
        {
            assert_eq!(probe(broken.clone()), None, "{broken}");
        }
    }
}
