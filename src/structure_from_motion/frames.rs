//! Which frames of a video become photos: the sharpest of each stretch of time, and none that is blurred.

use std::ops::RangeInclusive;

/// Frames that are taken of a video.
const FRAMES: RangeInclusive<usize> = 150..=300;

/// Frames that are taken of a second, within [`FRAMES`].
const FRAMES_PER_SEC: f64 = 3.0;

/// A frame is blurred if its sharpness is below this share of the best one near it. Measured: on the made video, frames that
/// are blurred over 0.8 % of the image have 0.02 to 0.3 of the sharpness of their neighbours, sharp ones at least 0.8.
const BLURRED_BELOW: f32 = 0.5;

/// How many frames to take of a video of this duration and number of frames.
pub fn count(duration_secs: f64, frames: usize, asked: Option<usize>) -> usize {
    let by_time = ((duration_secs * FRAMES_PER_SEC).round() as usize).clamp(*FRAMES.start(), *FRAMES.end());
    asked.unwrap_or(by_time).min(frames)
}

/// The sharpness of a grey image: the variance of its Laplacian. `[height, width]`
pub fn sharpness(grey: &[u8], width: usize) -> f32 {
    let height = grey.len() / width.max(1);
    if width < 3 || height < 3 {
        return 0.0;
    }
    let (mut sum, mut squares) = (0_i64, 0_i64);
    for y in 1..height - 1 {
        let row = |y: usize| &grey[y * width..(y + 1) * width];
        let (above, own, below) = (row(y - 1), row(y), row(y + 1));
        for x in 1..width - 1 {
            let around =
                i32::from(above[x]) + i32::from(below[x]) + i32::from(own[x - 1]) + i32::from(own[x + 1]);
            let value = i64::from(around - 4 * i32::from(own[x]));
            sum += value;
            squares += value * value;
        }
    }
    let count = ((width - 2) * (height - 2)) as f64;
    (squares as f64 / count - (sum as f64 / count).powi(2)) as f32
}

/// The sharpest frame of each of `count` stretches, in order; stretches whose frames are all blurred have none.
pub fn choose(sharpness: &[f32], count: usize) -> Vec<usize> {
    let frames = sharpness.len();
    let count = count.min(frames);
    // Two stretches to either side: hands are still for a moment now and then.
    let reach = 2 * frames.div_ceil(count.max(1)).max(2);
    let sharpest =
        |range: std::ops::Range<usize>| range.max_by(|a, b| sharpness[*a].total_cmp(&sharpness[*b]));
    (0..count)
        .filter_map(|bucket| sharpest(bucket * frames / count..(bucket + 1) * frames / count))
        .filter(|&frame| {
            let near = frame.saturating_sub(reach)..(frame + reach + 1).min(frames);
            let best = sharpest(near).map_or(0.0, |near| sharpness[near]);
            sharpness[frame] >= BLURRED_BELOW * best
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_frames_follow_the_duration() {
        assert_eq!(count(8.0, 240, None), 150);
        assert_eq!(count(80.0, 2400, None), 240);
        assert_eq!(count(3600.0, 9000, None), 300);
        assert_eq!((count(80.0, 2400, Some(40)), count(2.0, 60, None)), (40, 60));
    }

    #[test]
    fn the_sharpest_frame_of_each_stretch_is_taken_and_no_blurred_one() {
        // One in three is sharp, each a little sharper than the last.
        let of = |frame: usize| if frame % 3 == 1 { 100.0 + frame as f32 } else { 20.0 };
        let all: Vec<f32> = (0..240).map(of).collect();
        for count in [20, 60, 80, 150, 240] {
            let chosen = choose(&all, count);
            assert!(chosen.iter().all(|frame| frame % 3 == 1), "{count}: {chosen:?}");
            assert!(chosen.len() >= count.min(80) && chosen.is_sorted(), "{count}: {}", chosen.len());
        }
        let even = vec![7.0; 240];
        assert_eq!(choose(&even, 240).len(), 240, "negative control: none is blurred");
        assert_eq!(choose(&[], 5), Vec::<usize>::new());
    }

    #[test]
    fn blur_lowers_sharpness() {
        let stripes = |period: usize| {
            (0..64 * 8).map(|i| if i % 64 / period % 2 == 0 { 0 } else { 255 }).collect::<Vec<u8>>()
        };
        let blurred: Vec<u8> =
            stripes(4).windows(5).map(|w| (w.iter().map(|v| u32::from(*v)).sum::<u32>() / 5) as u8).collect();
        let (sharp, soft) = (sharpness(&stripes(4), 64), sharpness(&blurred[..64 * 7], 64));
        assert!(sharp > 4.0 * soft, "{sharp} {soft}");
        assert_eq!(sharpness(&[1; 4], 2), 0.0);
    }
}
