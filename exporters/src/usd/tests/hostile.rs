//! Damaged and hostile files, and assets that cannot be written.

use super::*;
use crate::asset::tests::{damaged, random};

#[test]
fn truncated_and_damaged_files_are_errors_or_valid() {
    let folder = tempfile::tempdir().unwrap();
    let asset = full(12, 1);
    let mut random = random(99);
    for extension in EXTENSIONS {
        let path = write(folder.path(), &format!("d.{extension}"), &asset, Quality::Balanced);
        let bytes = std::fs::read(&path).unwrap();
        for percent in 0..100 {
            std::fs::write(&path, &bytes[..bytes.len() * percent / 100]).unwrap();
            assert!(read(&path).is_err(), "{extension} cut to {percent} %");
            assert!(!validate(&path).is_empty());
        }
        let (mut refused, rounds) = (0, 600);
        for _ in 0..rounds {
            std::fs::write(&path, damaged(&bytes, 0..bytes.len(), &mut random)).unwrap();
            match read(&path) {
                Ok(contents) => contents.asset.validate().unwrap(),
                Err(_) => refused += 1,
            }
            validate(&path);
        }
        println!("{extension}: {refused} of {rounds} damaged files refused");
        assert!(refused > rounds / 10);
    }
}

#[test]
fn damaged_tables_never_panic() {
    let layer = layer_of(&full(3, 0));
    let bytes = binary_from_layer(&layer);
    let contents = u64::from_le_bytes(bytes[16..24].try_into().unwrap()) as usize;
    // Values come before the tables.
    let tables = u64::from_le_bytes(bytes[contents + 24..contents + 32].try_into().unwrap()) as usize;
    let mut random = random(7);
    for _ in 0..4000 {
        let damaged = damaged(&bytes, tables..bytes.len(), &mut random);
        let _ = layer_from_binary(&damaged, Path::new("b"), &ReadLimits::default());
    }
}

#[test]
fn hostile_counts_and_offsets_are_refused_at_once() {
    let bytes = binary_from_layer(&layer_of(&full(3, 0)));
    let contents = u64::from_le_bytes(bytes[16..24].try_into().unwrap()) as usize;
    let refused =
        |damaged: &[u8]| layer_from_binary(damaged, Path::new("b"), &ReadLimits::default()).is_err();
    for value in [u64::MAX, 1 << 62, u64::from(u32::MAX), 1 << 24] {
        let put = |at: usize| {
            let mut damaged = bytes.clone();
            damaged[at..at + 8].copy_from_slice(&value.to_le_bytes());
            refused(&damaged)
        };
        assert!(put(16) && put(contents), "{value}");
        for section in 0..6 {
            let entry = contents + 8 + 32 * section;
            assert!(put(entry + 16) && put(entry + 24), "section {section}: {value}");
            let start = u64::from_le_bytes(bytes[entry + 16..entry + 24].try_into().unwrap()) as usize;
            assert!(put(start), "count of section {section}: {value}");
        }
    }
    let mut newer = bytes.clone();
    newer[9] = 99;
    let error = layer_from_binary(&newer, Path::new("b"), &ReadLimits::default());
    assert!(matches!(error, Err(Error::Unsupported { .. })));
    // Less than the arrays need.
    let limits = ReadLimits { decoded_bytes: 100, layers: None };
    assert!(layer_from_binary(&bytes, Path::new("b"), &limits).is_err());
}

#[test]
fn unsupported_features_are_named() {
    let head = "#usda 1.0\n";
    let cases = [
        ("references", "def \"A\" (\n prepend references = @x.usda@\n)\n{\n}"),
        ("payload", "def \"A\" (\n payload = @x.usda@\n)\n{\n}"),
        ("timeSamples", "def \"A\" {\n float a.timeSamples = { 0: 1 }\n}"),
        ("matrix4d", "def \"A\" {\n matrix4d a = ((1))\n}"),
        ("subLayers", ""),
        ("half", "def \"A\" {\n half[] a = [1]\n}"),
        ("None", "def \"A\" {\n float a = None\n}"),
        ("reorder", "def \"A\" {\n reorder nameChildren = [\"B\"]\n}"),
        ("over", "over \"A\" {\n}"),
        ("paths", "def \"A\" {\n rel a = [</B>, </C>]\n}"),
        ("several lines", "def \"A\" {\n string a = \"\"\"b\"\"\"\n}"),
        ("variants", "def \"A\" (\n variants = {\n string b = \"c\"\n string d = \"e\"\n }\n)\n{\n}"),
        ("variant set", "def \"A\" {\n variantSet \"b\" = {\n }\n}"),
    ];
    for (word, body) in cases {
        let text =
            if body.is_empty() { format!("{head}(\n subLayers = [@a@]\n)") } else { format!("{head}{body}") };
        match layer_from_text(&text, Path::new("t"), 64 << 20) {
            Err(Error::Unsupported { what, .. }) => assert!(what.contains(word), "{word}: {what}"),
            other => panic!("{word}: {other:?}"),
        }
    }
    let deep = format!("{head}{}{}", "def \"A\" {".repeat(100_000), "}".repeat(100_000));
    assert!(layer_from_text(&deep, Path::new("t"), 64 << 20).is_err());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.usda");
    std::fs::write(&path, format!("{head}def Xform \"A\" {{\n}}\n")).unwrap();
    assert!(matches!(read(&path), Err(Error::Unsupported { .. })));
    assert!(matches!(read(&folder.path().join("a.obj")), Err(Error::Unsupported { .. })));
}

#[test]
fn pages_outside_the_folder_are_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let below = folder.path().join("below");
    std::fs::create_dir(&below).unwrap();
    let path = write(&below, "s.usda", &full(9, 0), Quality::Balanced);
    let text = std::fs::read_to_string(&path).unwrap();
    let page = "./s_usda_textures/page0.png";
    std::fs::copy(below.join(page), folder.path().join("page0.png")).unwrap();
    let absolute = folder.path().join("page0.png").display().to_string();
    for other in ["../page0.png", absolute.as_str(), "file:page0.png", "./s_usda_textures/missing.png"] {
        assert!(text.contains(page));
        std::fs::write(&path, text.replace(page, other)).unwrap();
        assert!(read(&path).is_err(), "{other}");
    }
    #[cfg(unix)]
    {
        std::fs::remove_file(below.join(page)).unwrap();
        std::os::unix::fs::symlink(folder.path().join("page0.png"), below.join(page)).unwrap();
        std::fs::write(&path, &text).unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("outside"));
    }
}

#[test]
fn failed_writes_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let asset = full(9, 0);
    let names = || std::fs::read_dir(folder.path()).unwrap().count();
    let fails = |name: &str, asset: &SplatAsset, options: &UsdOptions| {
        write_usd(&folder.path().join(name), asset, options).unwrap_err()
    };
    assert!(matches!(fails("a.usdz", &asset, &options(Quality::Tiny)), Error::Unsupported { .. }));
    assert!(matches!(fails("a.obj", &asset, &options(Quality::Balanced)), Error::Unsupported { .. }));
    assert!(fails("a@b.usda", &asset, &options(Quality::Balanced)).to_string().contains('@'));
    let small = UsdOptions { page_side: 4, ..options(Quality::Balanced) };
    assert!(matches!(fails("a.usdc", &asset, &small), Error::TooLarge { .. }));
    let mut zero = asset.clone();
    zero.provenance.author = "a\0b".into();
    assert!(fails("a.usdc", &zero, &options(Quality::Balanced)).to_string().contains("author"));
    let mut broken = asset.clone();
    broken.opacities[0] = 2.0;
    assert!(matches!(fails("a.usdz", &broken, &options(Quality::Balanced)), Error::Invalid { .. }));
    assert_eq!(names(), 0);
    // A folder in the place of the last file: images are removed again.
    std::fs::create_dir_all(folder.path().join("b.usdc/x")).unwrap();
    assert!(matches!(fails("b.usdc", &asset, &options(Quality::Balanced)), Error::Io { .. }));
    assert_eq!(names(), 1);
}

#[test]
fn small_text_cannot_exhaust_memory() {
    let head = "#usda 1.0\n(\n)\n";
    let long = "n".repeat(100_000);
    let bombs = [
        "def\"\"{}".repeat(100_000),
        format!("def \"a\" {{ {} }}", "int a ".repeat(100_000)),
        format!("def \"a\" {{ {} }}", "double a=0 ".repeat(100_000)),
        format!("def \"{long}\" {{ {} }}", "def\"\"{}".repeat(1000)),
        format!("def \"a\" {{ double[] a = [{}] }}", "0,".repeat(600_000)),
        format!("def \"a\" {{ token[] a = [{}] }}", "\"\",".repeat(200_000)),
    ];
    for bomb in bombs {
        let found = layer_from_text(&format!("{head}{bomb}"), Path::new("t"), 8 << 20);
        assert!(matches!(found, Err(Error::TooLarge { .. })), "{}", &bomb[..20]);
    }
    let small = format!("{head}def \"a\" {{ double[] a = [0, 1, 2] }}");
    assert!(layer_from_text(&small, Path::new("t"), 8 << 20).is_ok(), "negative control");
}

/// Bodies of texts with a hundred thousand of something, and whether a reader of ours takes them.
fn crowds() -> Vec<(&'static str, String, bool)> {
    let all = |one: &dyn Fn(usize) -> String| (0..100_000).map(one).collect::<String>();
    let set = "variants = { string r = \"v0\" } prepend variantSets = [\"r\"]";
    vec![
        (
            "choices",
            format!("def \"a\" ( variants = {{ {} }} ) {{}}", all(&|i| format!("string s{i} = \"x\" "))),
            false,
        ),
        (
            "variant sets",
            format!("def \"a\" ( prepend variantSets = [{}] ) {{}}", all(&|i| format!("\"s{i}\", "))),
            false,
        ),
        ("targets", format!("def \"a\" {{ rel b = [{}] }}", all(&|i| format!("</a{i}>, "))), false),
        ("relationships", format!("def \"a\" {{ {} }}", all(&|i| format!("rel r{i} = </a{i}> "))), true),
        (
            "variants",
            format!(
                "def \"a\" ( {set} ) {{ variantSet \"r\" = {{ {} }} }}",
                all(&|i| format!("\"v{i}\" {{}} "))
            ),
            true,
        ),
        ("prims", all(&|i| format!("def Xform \"a{i}\" {{}} ")), true),
        ("properties", format!("def \"a\" {{ {} }}", all(&|i| format!("int a{i} = {i} "))), true),
        ("connections", format!("def \"a\" {{ {} }}", all(&|i| format!("int a{i}.connect = </a.b> "))), true),
        (
            "schemas",
            format!("def \"a\" ( prepend apiSchemas = [{}\"x\"] ) {{}}", all(&|i| format!("\"s{i}\", "))),
            true,
        ),
        ("assets", format!("def \"a\" {{ {} }}", all(&|i| format!("asset a{i} = @./b{i}@ "))), true),
        ("escapes", format!("def \"a\" {{ string b = \"{}\" }}", all(&|_| "\\n".to_owned())), true),
        (
            "numbers",
            format!("def \"a\" {{ float2[] b = [{}(0, 1)] }}", all(&|i| format!("({i}, 0.5), "))),
            true,
        ),
    ]
}

#[test]
fn text_parsing_takes_linear_time() {
    // All of it in one line.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("crowd.usda");
    for (what, body, is_read) in crowds() {
        let text = format!("#usda 1.0\n( upAxis = \"Y\" )\n{body}");
        let start = std::time::Instant::now();
        let read = layer_from_text(&text, Path::new("t"), 1 << 30);
        assert_eq!(read.is_ok(), is_read, "{what}: {:?}", read.err());
        std::fs::write(&path, &text).unwrap();
        validate(&path);
        // Milliseconds each; quadratic ones took 13 to 37 seconds.
        assert!(start.elapsed().as_secs_f64() < 3.0, "{what}: {:?}", start.elapsed());
    }
}
