//! Mutated files of all formats are errors or valid assets, within bounded memory and time. A few seconds of mutations each time;
//! LITETEX_MUTATION_SECS asks for more, LITETEX_MUTATION_SEED for others. Measured without a finding: two CPU hours before there
//! were embedded files, and 26 CPU minutes since.

#[path = "common/mod.rs"]
mod common;
#[path = "common/hostile.rs"]
#[allow(dead_code, reason = "the corpus needs more of it")]
mod hostile;
#[path = "common/measured.rs"]
mod measured;

use litetex_exporters::{
    Format, Quality, ReadLimits, WriteOptions, gltf, read_asset, read_fallback, validate_file, write_asset,
};
use measured::{bytes_max, measured};
use std::path::Path;
use std::time::{Duration, Instant};
use twox_hash::XxHash3_64;

/// Time for each step; most take a millisecond, on a busy machine more.
const TIME_MAX: Duration = Duration::from_secs(10);

/// Parts of a `.ltgs` file: the header, an entry of the table of contents, and in an entry what locates a block.
const HEADER: usize = 64;
const ENTRY: usize = 112;
const BLOCK: usize = 24;

/// Pseudo-random numbers (SplitMix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A number below `end`; 0 if that is 0.
    fn below(&mut self, end: usize) -> usize {
        (self.next() % (end.max(1) as u64)) as usize
    }

    /// A position, near the start half of the time: that is where headers and tables are.
    fn place(&mut self, end: usize) -> usize {
        let end = if self.below(2) == 0 { end.min(512) } else { end };
        self.below(end)
    }
}

/// One to four changes; `others` lend bytes.
fn mutate(bytes: &mut Vec<u8>, others: &[Vec<u8>], random: &mut Random) {
    for _ in 0..=random.below(4) {
        let at = random.place(bytes.len());
        let run = 1 + random.below(64);
        match random.below(8) {
            0..=1 if !bytes.is_empty() => bytes[at] ^= 1 << random.below(8),
            2 if !bytes.is_empty() => bytes[at] = [0, 0xFF, 0x7F, random.next() as u8][random.below(4)],
            3 if at + 4 <= bytes.len() => {
                let value =
                    [0, 1, 4096, 65_536, u32::MAX / 2, u32::MAX, random.next() as u32][random.below(7)];
                bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
            }
            4 => drop(bytes.drain(at..(at + run).min(bytes.len()))),
            5 => drop(bytes.splice(at..at, (0..run).map(|_| random.next() as u8))),
            6 => {
                let other = &others[random.below(others.len())];
                let from = random.place(other.len());
                let lent = &other[from..(from + 4 * run).min(other.len())];
                let end = (at + lent.len()).min(bytes.len());
                bytes.splice(at..end, lent.iter().copied());
            }
            7 if random.below(4) == 0 => bytes.truncate(at),
            _ => {}
        }
    }
}

/// Where a `.ltgs` file begins in a `.glb`, which needs no more bytes than are there: a file found by its magic.
fn embedded(bytes: &[u8]) -> Option<usize> {
    bytes.windows(6).position(|window| window == b"LTGS\x03\0")
}

/// Makes the checksums of a `.ltgs` file right again, as far as its tables reach, so that damage gets past them.
fn seal(bytes: &mut [u8], random: &mut Random) {
    let number =
        |bytes: &[u8], at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight bytes"));
    let put =
        |bytes: &mut [u8], at: usize, number: u64| bytes[at..at + 8].copy_from_slice(&number.to_le_bytes());
    if bytes.len() < HEADER {
        return;
    }
    if random.below(2) == 0 {
        let length = bytes.len() as u64;
        put(bytes, 40, length);
    }
    let [meta, chunks] = [28, 36].map(|at| number(bytes, at) as u32 as usize);
    let start = HEADER + meta;
    let end = start + chunks * ENTRY;
    let len = bytes.len();
    for entry in (start..end.min(len)).step_by(ENTRY).filter(|entry| entry + ENTRY <= len) {
        for block in [entry, entry + BLOCK, entry + 2 * BLOCK] {
            let [at, length] = [block, block + 8].map(|at| number(bytes, at));
            let block_end = at.checked_add(length).filter(|&end| end <= bytes.len() as u64);
            if let Some(block_end) = block_end {
                let checksum = XxHash3_64::oneshot(&bytes[at as usize..block_end as usize]);
                put(bytes, block + 16, checksum);
            }
        }
    }
    if end <= bytes.len() {
        let checksum = XxHash3_64::oneshot(&bytes[HEADER..end]);
        put(bytes, 48, checksum);
    }
    let checksum = XxHash3_64::oneshot(&bytes[..56]);
    put(bytes, 56, checksum);
}

/// Valid files by extension: half of them `.ltgs`, of all qualities, some with layers.
fn originals() -> Vec<(&'static str, Vec<Vec<u8>>)> {
    let folder = tempfile::tempdir().expect("a folder");
    let mut compact: Vec<Vec<u8>> = Vec::new();
    for quality in [Quality::Lossless, Quality::Balanced, Quality::Tiny] {
        for (splats, degree) in [(1, 0), (40, 3), (300, 1)] {
            let path = folder.path().join("scene.ltgs");
            let options = WriteOptions { quality, ..WriteOptions::default() };
            write_asset(&path, &common::scene(splats, degree), &options).expect("written");
            compact.push(std::fs::read(&path).expect("read"));
        }
    }
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus");
    compact.extend(std::fs::read(corpus.join("layers.ltgs")));
    let mut all = Vec::new();
    for format in Format::ALL.into_iter().filter(|&format| format != Format::Ltgs) {
        all.push((Format::Ltgs.extension(), compact.clone()));
        let mut files = vec![hostile::valid(format)];
        if format == Format::Glb {
            files.extend([Quality::Lossless, Quality::Tiny, Quality::Tiny].map(|quality| {
                let options = gltf::GltfOptions { quality, ..gltf::GltfOptions::default() };
                gltf::encode_glb(&common::scene(40, 3), &options).expect("written")
            }));
        }
        all.push((format.extension(), files));
    }
    all
}

#[test]
fn mutated_files_are_errors_or_valid_assets() {
    let setting =
        |name: &str, usual: u64| std::env::var(name).map_or(usual, |v| v.parse().expect("a number"));
    let mut random = Random(setting("LITETEX_MUTATION_SEED", 1));
    let time = Duration::from_secs(setting("LITETEX_MUTATION_SECS", 5));
    let originals = originals();
    let (_, bytes, _) = measured(|| drop(vec![1_u8; 1 << 22]));
    assert!(bytes >= 1 << 22, "negative control: what is allocated counts");
    // A file at fault stays where it is.
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    std::fs::create_dir_all(folder).expect("made");
    let (start, limits) = (Instant::now(), ReadLimits::default());
    let [mut count, mut valid, mut sealed, mut past_checksums] = [0_u64; 4];
    let mut worst = (0, Duration::ZERO);
    while start.elapsed() < time {
        let (extension, files) = &originals[random.below(originals.len())];
        let mut bytes = files[random.below(files.len())].clone();
        mutate(&mut bytes, files, &mut random);
        let start = embedded(&bytes).filter(|_| random.below(8) > 0);
        if let Some(start) = start {
            seal(&mut bytes[start..], &mut random);
        }
        sealed += u64::from(start.is_some());
        let path = folder.join(format!("mutant-{}.{extension}", std::process::id()));
        std::fs::write(&path, &bytes).expect("written");
        let layers = [None, Some(1)][random.below(2)];
        let (read, of_read, read_time) = measured(|| read_asset(&path, &ReadLimits { layers, ..limits }));
        let (issues, of_issues, issues_time) = measured(|| validate_file(&path));
        let (_, of_fallback, fallback_time) = measured(|| drop(read_fallback(&path, &limits)));
        let (most, longest) =
            (of_read.max(of_issues).max(of_fallback), read_time.max(issues_time).max(fallback_time));
        assert!(most <= bytes_max(bytes.len()), "{}: {most} bytes of memory", path.display());
        assert!(longest < TIME_MAX, "{}: {longest:?}", path.display());
        issues.expect("the file is there");
        match read {
            Ok(contents) => {
                contents.asset.validate().expect("what is read is valid");
                valid += 1;
            }
            Err(error) => {
                past_checksums += u64::from(start.is_some() && !error.to_string().contains("checksum"))
            }
        }
        (count, worst) = (count + 1, (worst.0.max(most), worst.1.max(longest)));
        std::fs::remove_file(&path).expect("removed");
    }
    println!(
        "{count} mutants: {valid} valid, {past_checksums} of {sealed} sealed ones found out past checksums; at most {worst:?}"
    );
    // Negative control: neither do mutations leave files whole, nor do checksums catch those of sealed files.
    assert!(
        valid > 0 && valid < count && past_checksums > sealed / 2,
        "{valid}, {past_checksums} of {sealed}"
    );
}
