//! Test vectors of the coder of numbers, for authors of readers: numbers, their contexts and the coded bytes. The README of
//! `samples/conformance` explains the members.

use super::mixing::{LOG_ODDS, LOG_ODDS_MAX, squash};
use super::numbers::NumberWriter;
use serde_json::{Value, json};
use twox_hash::XxHash3_64;

/// Numbers of a long stream: those from `VARIED` on are zeros, but for the last one.
const LONG: usize = 3000;
const VARIED: usize = 2000;

/// A stream: numbers, and for each the contexts beyond the first, of which as many are used as the stream has.
struct TestStream {
    name: &'static str,
    numbers: Vec<u32>,
    contexts: [Vec<u32>; 2],
}

impl TestStream {
    fn new(name: &'static str, numbers: Vec<u32>, contexts: impl Fn(u32) -> [u32; 2]) -> Self {
        let all: Vec<[u32; 2]> = (0..numbers.len() as u32).map(contexts).collect();
        let contexts = [0, 1].map(|k| all.iter().map(|own| own[k]).collect());
        Self { name, numbers, contexts }
    }

    /// The coded bytes with this many contexts beyond the first.
    fn coded(&self, beyond: usize) -> Vec<u8> {
        let mut writer = NumberWriter::new(beyond);
        for (i, &number) in self.numbers.iter().enumerate() {
            writer.put(number, &[self.contexts[0][i], self.contexts[1][i]][..beyond]);
        }
        writer.finish().1
    }

    /// The entry for this many contexts beyond the first; numbers of long streams follow from the generator.
    fn entry(&self, beyond: usize) -> Value {
        let bytes = self.coded(beyond);
        let mut entry = json!({ "name": self.name, "count": self.numbers.len() });
        if self.numbers.len() < LONG {
            entry["numbers"] = json!(self.numbers);
        }
        entry["numbersXxh3"] = hash(self.numbers.iter().flat_map(|u| u.to_le_bytes()));
        entry["contexts"] = if self.numbers.len() < LONG {
            json!(self.contexts[..beyond])
        } else {
            json!(["i mod 7", "i mod 3"][..beyond])
        };
        entry["bytesXxh3"] = hash(bytes.iter().copied());
        entry["bytes"] = json!(bytes.iter().map(|byte| format!("{byte:02x}")).collect::<String>());
        entry
    }
}

fn hash(bytes: impl Iterator<Item = u8>) -> Value {
    json!(format!("{:016x}", XxHash3_64::oneshot(&bytes.collect::<Vec<_>>())))
}

/// Small and large numbers by their contexts, some of up to 32 bits, then a long run of zeros.
fn generated() -> Vec<u32> {
    let mut state = 1_u64;
    let number = |i: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let random = (state >> 40) as u32 & 0xffff;
        match i {
            _ if i == LONG - 1 => 1,
            VARIED.. => 0,
            _ if i % 100 == 99 => (u32::MAX - i as u32) >> (i / 100),
            _ => (random >> (2 * (i % 7) + 2)) + 5 * (i as u32 % 3),
        }
    };
    (0..LONG).map(number).collect()
}

/// The test vectors as JSON, each stream with one, two and three contexts: the same text always.
pub fn coder_vectors() -> String {
    let small = vec![0, 1, 2, 300, 70_000, 0, 0, 5];
    let large =
        vec![u32::MAX, 0, 1 << 31, (1 << 31) - 1, u32::MAX - 1, 1, 65_535, 65_536, u32::MAX, u32::MAX];
    let streams = [
        TestStream::new("empty", Vec::new(), |_| [0; 2]),
        TestStream::new("specification", small, |i| [i % 2, 7]),
        TestStream::new("32 bits", large, |i| [i / 3, 500 - i]),
        TestStream::new("zeros", vec![0; 40], |_| [0; 2]),
        TestStream::new("generated", generated(), |i| [i % 7, i % 3]),
    ];
    let entries: Vec<Value> = streams.iter().flat_map(|s| (0..3).map(|beyond| s.entry(beyond))).collect();
    let odds = -LOG_ODDS_MAX..=LOG_ODDS_MAX;
    let vectors = json!({
        "schema": "litetex-coder/1",
        "tables": {
            "S": hash(odds.flat_map(|d| (squash(d) as u16).to_le_bytes())),
            "D": hash(LOG_ODDS.iter().flat_map(|d| d.to_le_bytes())),
        },
        "streams": entries,
    });
    format!("{vectors:#}\n")
}

#[cfg(test)]
mod tests {
    use super::super::numbers::NumberReader;
    use super::*;

    #[test]
    fn the_conformance_pack_has_the_vectors_of_this_coder() {
        let committed = include_str!("../../../samples/conformance/coder.json");
        // Not `assert_eq`, which would print all of it.
        assert!(committed == coder_vectors(), "samples/conformance/coder.json: make the pack anew");
        // Negative control: other numbers, other bytes.
        let stream = |numbers| TestStream::new("a", numbers, |i| [i, 0]);
        assert_ne!(stream(vec![1, 2, 3]).coded(1), stream(vec![1, 2, 4]).coded(1));
    }

    #[test]
    fn vectors_cover_what_readers_get_wrong() {
        let vectors: Value = serde_json::from_str(&coder_vectors()).unwrap();
        let streams = vectors["streams"].as_array().unwrap();
        assert_eq!(streams.len(), 15);
        for entry in streams {
            let hex = entry["bytes"].as_str().unwrap();
            let byte = |i: usize| u8::from_str_radix(&hex[2 * i..2 * i + 2], 16).unwrap();
            let bytes: Vec<u8> = (0..hex.len() / 2).map(byte).collect();
            let count = entry["count"].as_u64().unwrap() as usize;
            let contexts = entry["contexts"].as_array().unwrap();
            let context = |k: usize, i: usize| match &contexts[k] {
                Value::Array(all) => all[i].as_u64().unwrap() as u32,
                _ => i as u32 % [7, 3][k],
            };
            let own = |i: usize| (0..contexts.len()).map(|k| context(k, i)).collect::<Vec<_>>();
            let decoded = |bytes: &[u8]| {
                let mut reader = NumberReader::new(bytes, count, contexts.len()).unwrap();
                let numbers: Vec<u32> = (0..count).map(|i| reader.take(&own(i))).collect();
                (hash(numbers.into_iter().flat_map(u32::to_le_bytes)), reader.finish().is_ok())
            };
            if count > 0 {
                let stated = (entry["numbersXxh3"].clone(), true);
                assert_eq!(decoded(&bytes), stated, "{entry}");
                // Negative controls: bytes too many, and a bit of the first one.
                assert!(!decoded(&[&bytes[..], &[1; 8]].concat()).1, "{entry}");
                if let [first, rest @ ..] = &bytes[..] {
                    assert_ne!(decoded(&[&[first ^ 0x40], rest].concat()), stated, "{entry}");
                }
            }
        }
        // The generated numbers have all lengths up to 31, and their contexts tell something: three contexts need fewer bytes than one.
        let length = |place: usize| streams[place]["bytes"].as_str().unwrap().len();
        assert!(length(14) * 10 < length(12) * 9, "{} {}", length(14), length(12));
        let lengths: std::collections::BTreeSet<u32> =
            generated().into_iter().map(super::super::numbers::length).collect();
        assert!((0..32).all(|length| lengths.contains(&length)), "{lengths:?}");
    }
}
