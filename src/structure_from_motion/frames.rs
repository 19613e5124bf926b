//! Which frames of a video become photos: the sharpest of each stretch of time, and none that is blurred.

use std::ops::RangeInclusive;

/// Frames that are taken of a video.
const FRAMES: RangeInclusive<usize> = 150..=300;

/// Frames that are taken of a second, within [`FRAMES`].
const FRAMES_PER_SEC: f64 = 3.0;

/// A frame is blurred if it has less than this share of the detail that frames near it have in some direction.
/// Measured: sharp frames of made videos keep at least 0.71 of it, blurred ones at most 0.37. Motion over 3 of 640 pixels leaves
/// photos of fox, flower and bonsai at most 0.32, over 2 pixels 0.36 to 0.60. Their sharp photos stand further apart than
/// frames do: 0 of 25 (flower), 4 of 40 (fox) and 3 of 22 (bonsai) fall below.
const BLURRED_BELOW: f32 = 0.5;

/// Detail of a frame along rows, columns and both diagonals. Motion blurs along its own direction only.
pub type Detail = [f32; 4];

/// How many frames to take of a video of this duration and number of frames.
pub fn count(duration_secs: f64, frames: usize, asked: Option<usize>) -> usize {
    let by_time = ((duration_secs * FRAMES_PER_SEC).round() as usize).clamp(*FRAMES.start(), *FRAMES.end());
    asked.unwrap_or(by_time).min(frames)
}

/// The detail of a grey image: mean squares of second differences. `[height, width]`
pub fn detail(grey: &[u8], width: usize) -> Detail {
    let height = grey.len() / width.max(1);
    if width < 3 || height < 3 {
        return [0.0; 4];
    }
    let mut sums = [0_u64; 4];
    let steps = [1, width, width + 1, width - 1];
    for y in 1..height - 1 {
        for at in y * width + 1..(y + 1) * width - 1 {
            for (sum, step) in sums.iter_mut().zip(steps) {
                let value = i32::from(grey[at - step]) + i32::from(grey[at + step]) - 2 * i32::from(grey[at]);
                *sum += u64::from((value * value).unsigned_abs());
            }
        }
    }
    let count = ((width - 2) * (height - 2)) as f64;
    sums.map(|sum| (sum as f64 / count) as f32)
}

/// The sharpest frame of each of `count` stretches, in order; stretches whose frames are all blurred have none.
pub fn choose(details: &[Detail], count: usize) -> Vec<usize> {
    let frames = details.len();
    let count = count.min(frames);
    // Two stretches to either side: hands are still for a moment now and then.
    let reach = 2 * frames.div_ceil(count.max(1)).max(2);
    // The smallest share of the detail that the frames near have in each direction.
    let sharpness = |frame: usize| {
        let near = &details[frame.saturating_sub(reach)..(frame + reach + 1).min(frames)];
        let share = |direction: usize| {
            let best = near.iter().map(|detail| detail[direction]).fold(f32::MIN_POSITIVE, f32::max);
            details[frame][direction] / best
        };
        (0..4).map(share).fold(1.0, f32::min)
    };
    let sharpness: Vec<f32> = (0..frames).map(sharpness).collect();
    (0..count)
        .filter_map(|stretch| {
            let all = stretch * frames / count..(stretch + 1) * frames / count;
            all.max_by(|a, b| sharpness[*a].total_cmp(&sharpness[*b]))
        })
        .filter(|frame| sharpness[*frame] >= BLURRED_BELOW)
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
        // One in three is sharp, each a little sharper than the last; the others lack detail in one direction or all.
        let of = |frame: usize| match frame % 3 {
            1 => [100.0 + frame as f32; 4],
            0 => [100.0, 20.0, 90.0, 95.0],
            _ => [20.0; 4],
        };
        let all: Vec<Detail> = (0..240).map(of).collect();
        for count in [20, 60, 80, 150, 240] {
            let chosen = choose(&all, count);
            assert!(chosen.iter().all(|frame| frame % 3 == 1), "{count}: {chosen:?}");
            assert!(chosen.len() >= count.min(80) && chosen.is_sorted(), "{count}: {}", chosen.len());
        }
        let even = vec![[7.0; 4]; 240];
        assert_eq!(choose(&even, 240).len(), 240, "negative control: none is blurred");
        assert_eq!(choose(&[], 5), Vec::<usize>::new());
    }

    #[test]
    fn blur_lowers_detail_in_its_direction() {
        // A checkerboard of 4 pixels, and the same blurred along its rows.
        let at = |x: usize, y: usize| if (x / 4 + y / 4).is_multiple_of(2) { 0_u8 } else { 240 };
        let image = |blur: usize| -> Vec<u8> {
            let mean = |x, y| ((0..blur).map(|k| u32::from(at(x + k, y))).sum::<u32>() / blur as u32) as u8;
            (0..64 * 64).map(|i| mean(i % 64, i / 64)).collect()
        };
        let (sharp, soft) = (detail(&image(1), 64), detail(&image(3), 64));
        assert!(soft[0] < 0.3 * sharp[0] && soft[1] > 0.5 * sharp[1], "{sharp:?} {soft:?}");
        assert_eq!(detail(&[1; 4], 2), [0.0; 4]);
    }
}
