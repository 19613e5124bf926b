//! Hostile and odd files of all formats, made from small scenes and named by what is wrong with them. Reproducible.

use crate::common::scene;
use Expect::{Invalid, Reads, TooLarge, Unsupported};
use litetex_exporters::{
    AssetMap, Format, Quality, SplatAsset, WriteOptions, gltf, html, ltgs, ply, spz, write_asset,
};
use serde_json::{Value, json};
use twox_hash::XxHash3_64;

/// What a reader must answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Expect {
    /// It is read: what is odd about it is harmless, or reported by validation.
    Reads,
    Invalid,
    Unsupported,
    TooLarge,
}

/// A file of the corpus.
pub struct File {
    pub name: String,
    pub bytes: Vec<u8>,
    pub expect: Expect,
}

/// All files of the corpus, by name.
pub fn all() -> Vec<File> {
    let mut files = damaged();
    let mut add =
        |name: &str, expect, bytes: Vec<u8>| files.push(File { name: name.to_owned(), bytes, expect });
    glb(&mut add);
    gltf_text(&mut add);
    ltgs_files(&mut add);
    html_files(&mut add);
    usda(&mut add);
    usdc(&mut add);
    usdz(&mut add);
    ply_files(&mut add);
    spz_files(&mut add);
    files.sort_by(|a, b| a.name.cmp(&b.name));
    files
}

/// Maps of 2 x 2, none, 5 x 3, 2 x 2.
fn small_scene() -> SplatAsset {
    SplatAsset { cameras: Vec::new(), ..scene(4, 0) }
}

type Add<'a> = &'a mut dyn FnMut(&str, Expect, Vec<u8>);

/// A page that draws nothing: files of the corpus do not change with the one that does.
const PAGE: &str = "<!doctype html><meta charset=\"utf-8\"><title></title><body><script>0</script>";

/// A valid file. Text and binary USD have no maps, so that they need no pages next to them.
pub fn valid(format: Format) -> Vec<u8> {
    if format == Format::Html {
        let asset = small_scene();
        return html::wrapped(&html::Page::new(PAGE), &valid(Format::Ltgs), &asset.provenance)
            .expect("written");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene").with_extension(format.extension());
    let mut asset = small_scene();
    if matches!(format, Format::Usda | Format::Usdc) {
        asset = asset.untextured();
    }
    let options = WriteOptions { quality: Quality::Balanced, ..WriteOptions::default() };
    write_asset(&path, &asset, &options).expect("written");
    std::fs::read(&path).expect("read")
}

/// Damage of the same kinds for every format.
fn damaged() -> Vec<File> {
    let mut files = Vec::new();
    for format in Format::ALL {
        let bytes = valid(format);
        let mut add = |name: &str, bytes: Vec<u8>| {
            let name = format!("{name}.{}", format.extension());
            files.push(File { name, bytes, expect: Invalid });
        };
        add("empty", Vec::new());
        add("truncated", bytes[..bytes.len() * 2 / 3].to_vec());
        add("wrong_magic", [b"GARBAGE!", &bytes[8.min(bytes.len())..bytes.len().min(600)]].concat());
    }
    files
}

fn replaced(text: &[u8], from: &str, to: &str) -> Vec<u8> {
    let text = String::from_utf8(text.to_vec()).expect("text");
    assert!(text.contains(from), "{from}");
    text.replacen(from, to, 1).into_bytes()
}

fn put(bytes: &[u8], at: usize, new: &[u8]) -> Vec<u8> {
    let mut out = bytes.to_vec();
    out[at..at + new.len()].copy_from_slice(new);
    out
}

fn number(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(std::array::from_fn(|i| bytes[at + i])) as usize
}

/// JSON and bytes of a `.glb`.
fn split(glb: &[u8]) -> (Value, Vec<u8>) {
    let end = 20 + number(glb, 12);
    (serde_json::from_slice(&glb[20..end]).expect("JSON"), glb[end + 8..].to_vec())
}

fn join(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let total = 28 + json.len() + bin.len();
    let mut out = b"glTF".to_vec();
    out.extend([2, total as u32, json.len() as u32].iter().flat_map(|v| v.to_le_bytes()));
    out.extend(b"JSON");
    out.extend(json);
    out.extend((bin.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(bin);
    out
}

const PRIMITIVE: &str = "/meshes/0/primitives/0";
const OURS: &str =
    "/meshes/0/primitives/0/extensions/KHR_gaussian_splatting/extensions/LITETEX_gaussian_splatting_texture";

/// First byte of an attribute's data.
fn place(json: &Value, name: &str) -> usize {
    let accessor =
        json.pointer(PRIMITIVE).expect("a primitive")["attributes"][name].as_u64().expect("an accessor");
    let view = json["accessors"][accessor as usize]["bufferView"].as_u64().expect("a view");
    json["bufferViews"][view as usize]["byteOffset"].as_u64().unwrap_or(0) as usize
}

fn glb(add: Add<'_>) {
    let asset = small_scene();
    let options =
        gltf::GltfOptions { quality: Quality::Balanced, page_side: 64, ..gltf::GltfOptions::default() };
    let bytes = gltf::encode_glb(&asset, &options).expect("written");
    let (valid, bin) = split(&bytes);
    let edited = |change: &dyn Fn(&mut Value)| {
        let mut json = valid.clone();
        change(&mut json);
        join(&json, &bin)
    };
    let tiny = gltf::GltfOptions { quality: Quality::Tiny, ..options };
    let (streamed, with_stream) = split(&gltf::encode_glb(&asset, &tiny).expect("written"));
    let mut other_codec = streamed.clone();
    at(&mut other_codec, OURS)["stream"]["mimeType"] = json!("application/zip");
    add("other_codec.glb", Unsupported, join(&other_codec, &with_stream));
    // The stream stands first.
    let last = streamed["bufferViews"][0]["byteLength"].as_u64().expect("bytes") as usize - 1;
    add("damaged_stream.glb", Invalid, join(&streamed, &put(&with_stream, last, &[with_stream[last] ^ 1])));
    let mut too_few = streamed.clone();
    too_few["accessors"].as_array_mut().expect("accessors").iter_mut().for_each(|a| a["count"] = json!(3));
    add("stream_of_more_splats.glb", Invalid, join(&too_few, &with_stream));
    add("newer_container.glb", Unsupported, put(&bytes, 4, &[3]));
    add("newer_extension.glb", Unsupported, edited(&|j| at(j, OURS)["version"] = json!(gltf::VERSION + 1)));
    add("older_extension.glb", Unsupported, edited(&|j| at(j, OURS)["version"] = json!(gltf::VERSION - 1)));
    add(
        "no_shifts.glb",
        Reads,
        edited(&|j| drop(at(j, OURS).as_object_mut().expect("ours").remove("shift"))),
    );
    add("huge_count.glb", Invalid, edited(&|j| j["accessors"][0]["count"] = json!(1_u64 << 40)));
    add(
        "huge_page.glb",
        TooLarge,
        edited(&|j| {
            at(j, OURS)["atlas"][0]["width"] = json!(8192);
            at(j, OURS)["atlas"][0]["height"] = json!(8192);
        }),
    );
    add(
        "same_page_many_times.glb",
        Reads,
        edited(&|j| {
            let page = at(j, OURS)["atlas"][0].clone();
            at(j, OURS)["atlas"] = json!(vec![page; 60]);
        }),
    );
    add(
        "many_nodes.glb",
        Reads,
        edited(&|j| {
            j["nodes"].as_array_mut().expect("nodes").extend(vec![json!({}); 1000]);
        }),
    );
    add(
        "cyclic_nodes.glb",
        Invalid,
        edited(&|j| {
            j["nodes"][0]["children"] = json!([1]);
            j["nodes"].as_array_mut().expect("nodes").push(json!({"children": [0]}));
        }),
    );
    let rects = at(&mut valid.clone(), OURS)["rects"].as_u64().expect("an accessor") as usize;
    let view = valid["accessors"][rects]["bufferView"].as_u64().expect("a view") as usize;
    let first = valid["bufferViews"][view]["byteOffset"].as_u64().unwrap_or(0) as usize;
    let changed = |at: usize, new: &[u8]| join(&valid, &put(&bin, at, new));
    // Splats 0 and 3 have maps of 2 x 2.
    let corner: [u8; 4] = std::array::from_fn(|i| bin[first + i]);
    add("overlapping_maps.glb", Reads, changed(first + 24, &corner));
    let coloured =
        gltf::encode_glb(&SplatAsset { cameras: Vec::new(), ..scene(4, 1) }, &options).expect("written");
    let (mut json, coloured) = split(&coloured);
    let degrees = at(&mut json, OURS)["shDegree"].as_u64().expect("an accessor") as usize;
    let view = json["accessors"][degrees]["bufferView"].as_u64().expect("a view") as usize;
    let first_degree = json["bufferViews"][view]["byteOffset"].as_u64().expect("an offset") as usize;
    add("coefficients_above_the_degree.glb", Invalid, join(&json, &put(&coloured, first_degree, &[0])));
    add("degree_above_the_coefficients.glb", Invalid, join(&json, &put(&coloured, first_degree, &[2])));
    let five: Vec<u8> = 5.0_f32.to_le_bytes().repeat(12);
    let nan = f32::NAN.to_le_bytes();
    let dc = place(&valid, "KHR_gaussian_splatting:SH_DEGREE_0_COEF_0");
    add("wrong_colours_for_others.glb", Reads, changed(dc, &five));
    add("nan_colours_for_others.glb", Invalid, changed(dc, &nan));
    add("nan_position.glb", Invalid, changed(place(&valid, "POSITION"), &nan));
    let scale = place(&valid, "KHR_gaussian_splatting:SCALE");
    add("thick_for_others.glb", Reads, changed(scale + 8, &1000.0_f32.to_le_bytes()));
}

fn at<'a>(json: &'a mut Value, pointer: &str) -> &'a mut Value {
    json.pointer_mut(pointer).expect("is there")
}

fn gltf_text(add: Add<'_>) {
    let text = valid(Format::Gltf);
    add("missing_buffer.gltf", Invalid, text);
    for (name, uri, expect) in [
        ("uri_leaves_the_folder.gltf", "../outside.bin", Invalid),
        ("uri_leaves_the_folder_escaped.gltf", "%2e%2e/outside.bin", Invalid),
        ("uri_is_absolute.gltf", "/etc/passwd", Invalid),
        ("uri_of_data.gltf", "data:application/octet-stream;base64,AAAA", Unsupported),
        ("uri_of_the_network.gltf", "https://example.org/a.bin", Unsupported),
    ] {
        let json = json!({"asset": {"version": "2.0"}, "buffers": [{"byteLength": 4, "uri": uri}]});
        add(name, expect, json.to_string().into_bytes());
    }
    let deep = format!("{}{}", "[".repeat(2000), "]".repeat(2000));
    let nested = format!(
        "{{\"asset\":{{\"version\":\"2.0\"}},\"meshes\":[{{\"primitives\":[{{\"extras\":{deep}}}]}}]}}"
    );
    add("deep_json.gltf", Invalid, nested.into_bytes());
}

/// Sets the checksum of an `.ltgs` header.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let checksum = XxHash3_64::oneshot(&bytes[..56]);
    bytes[56..64].copy_from_slice(&checksum.to_le_bytes());
    bytes
}

/// Changes metadata or table of contents of an `.ltgs` file, and sets their checksum and that of the header.
fn retabled(bytes: &[u8], at: usize, new: &[u8]) -> Vec<u8> {
    let changed = put(bytes, at, new);
    let end = 64 + number(&changed, 28) + 112 * number(&changed, 36);
    let tables = XxHash3_64::oneshot(&changed[64..end]);
    sealed(put(&changed, 48, &tables.to_le_bytes()))
}

/// Splats in several layers that are so alike that the file is small.
fn equal_splats() -> SplatAsset {
    let n = 10_000;
    SplatAsset {
        sh_degrees: vec![0; n],
        positions: vec![[0.0; 3]; n],
        rotations: vec![[1.0, 0.0, 0.0, 0.0]; n],
        scales: vec![[0.5; 2]; n],
        opacities: vec![1.0; n],
        sh: vec![0.0; 3 * n],
        maps: vec![AssetMap::default(); n],
        ..SplatAsset::default()
    }
}

fn ltgs_files(add: Add<'_>) {
    let file = |asset: &SplatAsset, quality| {
        ltgs::encode(asset, &ltgs::LtgsOptions { quality, ..ltgs::LtgsOptions::default() }).expect("written")
    };
    let bytes = file(&small_scene(), Quality::Balanced);
    add("newer_major_version.ltgs", Unsupported, sealed(put(&bytes, 4, &[4])));
    add("older_major_version.ltgs", Unsupported, sealed(put(&bytes, 4, &[2])));
    add("newer_minor_version.ltgs", Reads, sealed(put(&bytes, 6, &[9])));
    add("unknown_feature.ltgs", Unsupported, sealed(put(&bytes, 8, &[1])));
    add("wrong_checksum.ltgs", Invalid, put(&bytes, 12, &[9]));
    add("huge_count_of_splats.ltgs", TooLarge, sealed(put(&bytes, 12, &u32::MAX.to_le_bytes())));
    add("huge_count_of_texels.ltgs", TooLarge, sealed(put(&bytes, 16, &(1_u64 << 31).to_le_bytes())));
    add("wrong_count_of_texels.ltgs", Invalid, sealed(put(&bytes, 16, &7_u64.to_le_bytes())));
    // The block of SH over that of geometry.
    let (table, length) = (64 + number(&bytes, 28), bytes.len());
    add("overlapping_blocks.ltgs", Invalid, retabled(&bytes, table + 24, &bytes[table..table + 8]));
    let layered = file(&equal_splats(), Quality::Tiny);
    let layer_at = |chunk: usize| 64 + number(&layered, 28) + 112 * chunk + 84;
    // Three layers of 1, 1 and 2 chunks.
    assert_eq!([0, 1, 2, 3].map(|chunk| number(&layered, layer_at(chunk))), [0, 1, 2, 2]);
    add("layers.ltgs", Reads, layered.clone());
    add("first_layer_missing.ltgs", Invalid, retabled(&layered, layer_at(0), &[1]));
    add("layer_left_out.ltgs", Invalid, retabled(&layered, layer_at(1), &[2]));
    add("layers_out_of_order.ltgs", Invalid, retabled(&layered, layer_at(3), &[1]));
    add("short_chunk_within_a_layer.ltgs", Invalid, retabled(&layered, layer_at(1), &[0]));
    let too_many = sealed(put(&layered, 36, &u32::MAX.to_le_bytes()));
    add("huge_count_of_chunks.ltgs", Invalid, too_many);
    add("cut_off_behind_a_layer.ltgs", Invalid, layered[..number(&layered, layer_at(1) - 84)].to_vec());
    add("damaged_chunk.ltgs", Invalid, put(&bytes, length - 9, &[bytes[length - 9] ^ 1]));
    let with_stand_in = |file: &[u8]| {
        let stand_in = Some(ltgs::StandIn { file, until_bytes: 9 });
        let options = ltgs::LtgsOptions { quality: Quality::Tiny, stand_in, ..ltgs::LtgsOptions::default() };
        ltgs::encode(&small_scene(), &options).expect("written")
    };
    let small = file(&scene(2, 0), Quality::Tiny);
    let with = with_stand_in(&small);
    let at = 64 + number(&with, 28) + 112 + small.len() / 2;
    add("damaged_stand_in.ltgs", Reads, put(&with, at, &[with[at] ^ 1]));
    add("stand_in_of_a_stand_in.ltgs", Reads, with_stand_in(&with));
    add("stand_in_that_is_none.ltgs", Reads, with_stand_in(b"not a file of splats"));
    add("stand_in.ltgs", Reads, with);
}

fn html_files(add: Add<'_>) {
    let bytes = valid(Format::Html);
    let ltgs = valid(Format::Ltgs);
    let title = &small_scene().provenance;
    let around = |ltgs: &[u8]| html::wrapped(&html::Page::new(PAGE), ltgs, title).expect("written");
    add("foreign.html", Invalid, b"<!DOCTYPE html>\n<title>Mine</title><p id=\"litetex\">Nothing".to_vec());
    add(
        "asset_in_a_comment.html",
        Invalid,
        replaced(&replaced(&bytes, "<body>", "<body><!--"), "</script><script>", "--></script><script>"),
    );
    add("asset_of_another_type.html", Invalid, replaced(&bytes, "vnd.litetex.ltgs;base64", "octet-stream"));
    add("bad_base64.html", Invalid, replaced(&bytes, "TFRHU", "TFR U"));
    add("two_assets.html", Invalid, [&bytes[..], &bytes[..]].concat());
    add("no_bytes.html", Invalid, around(b""));
    add("not_of_splats.html", Invalid, around(b"not a file of splats"));
    add("truncated_inside.html", Invalid, around(&ltgs[..ltgs.len() * 2 / 3]));
    add("policy_taken_out.html", Reads, replaced(&bytes, "Content-Security-Policy", "x"));
    for (name, bytes) in many_tags(2000) {
        add(name, Invalid, bytes);
    }
}

/// Pages of this many bytes of beginnings of comments, elements, ends and attributes.
fn many_tags(num_bytes: usize) -> [(&'static str, Vec<u8>); 4] {
    let page = |first: &str, what: &str, last: &str| {
        [first, &what.repeat(num_bytes / what.len()), last].concat().into_bytes()
    };
    [
        ("many_comments.html", page("<!doctype html>", "<!-", "")),
        ("many_ends.html", page("<!doctype html><script>", "</scrip", "")),
        ("many_quotes.html", page("<!doctype html>", "<a '", "")),
        ("many_attributes.html", page("<!doctype html><a ", "a=b ", ">")),
    ]
}

fn usda(add: Add<'_>) {
    let text = valid(Format::Usda);
    let head = "#usda 1.0\n(\n    upAxis = \"Y\"\n)\n";
    let small = |body: String| format!("{head}{body}\n").into_bytes();
    add("newer_version.usda", Unsupported, b"#usda 2.0\n".to_vec());
    add("reference.usda", Unsupported, small("def \"a\" ( references = @b.usda@ ) {}".into()));
    add("time_samples.usda", Unsupported, small("def \"a\" { double b.timeSamples = { 0: 1 } }".into()));
    add("foreign.usda", Unsupported, small("def Xform \"a\" { def Mesh \"b\" { int c = 3 } }".into()));
    add("deep_prims.usda", Unsupported, small("def \"a\" { ".repeat(200) + &"}".repeat(200)));
    add("many_prims.usda", Unsupported, small("def \"a\"{}".repeat(300)));
    let long = "n".repeat(2500);
    add("long_paths.usda", Unsupported, small(format!("def \"{long}\" {{ {} }}", "def \"a\"{}".repeat(200))));
    add(
        "many_texts.usda",
        Unsupported,
        small(format!("def \"a\" {{ token[] b = [{}\"\"] }}", "\"\",".repeat(999))),
    );
    add("open_quote.usda", Invalid, small("def \"a".into()));
    add("comment.usda", Unsupported, small("# made by hand".into()));
    add(
        "variants_of_others.usda",
        Unsupported,
        small("def \"a\" ( prepend variantSets = [\"b\", \"c\"] ) {}".into()),
    );
    add("several_targets.usda", Unsupported, small("def \"a\" { rel b = [</c>, </d>] }".into()));
    add(
        "nan.usda",
        Invalid,
        replaced(&text, "point3f[] positions = [(", "point3f[] positions = [(nan, 0, 0), ("),
    );
    add(
        "newer_arrays.usda",
        Unsupported,
        replaced(&text, "int primvars:litetex:version = 3", "int primvars:litetex:version = 4"),
    );
    add(
        "older_arrays.usda",
        Unsupported,
        replaced(&text, "int primvars:litetex:version = 3", "int primvars:litetex:version = 2"),
    );
}

fn usdc(add: Add<'_>) {
    let bytes = valid(Format::Usdc);
    add("newer_version.usdc", Unsupported, put(&bytes, 9, &[10]));
    add("tables_beyond_the_end.usdc", Invalid, put(&bytes, 16, &u64::MAX.to_le_bytes()));
    let contents = number(&bytes, 16);
    add("huge_count_of_sections.usdc", Invalid, put(&bytes, contents, &u64::MAX.to_le_bytes()));
    for (section, name) in ["tokens", "strings", "fields"].into_iter().enumerate() {
        let start = number(&bytes, contents + 8 + 32 * section + 16);
        let name = format!("huge_count_of_{name}.usdc");
        add(&name, Invalid, put(&bytes, start, &(1_u64 << 40).to_le_bytes()));
    }
}

/// Places of a signature in a file.
fn places(bytes: &[u8], signature: &[u8]) -> Vec<usize> {
    (0..bytes.len()).filter(|&at| bytes[at..].starts_with(signature)).collect()
}

fn usdz(add: Add<'_>) {
    let bytes = valid(Format::Usdz);
    let end = *places(&bytes, b"PK\x05\x06").last().expect("an end");
    let count = [60_000_u16.to_le_bytes(); 2].concat();
    add("huge_count_of_entries.usdz", TooLarge, put(&bytes, end + 8, &count));
    let [local, central] = [b"PK\x03\x04", b"PK\x01\x02"].map(|s| places(&bytes, s)[0]);
    // A name of the same length that leads out of the folder, in both places.
    let renamed = |name: &[u8; 10]| put(&put(&bytes, local + 30, name), central + 46, name);
    add("path_traversal.usdz", Invalid, renamed(b"../../a.us"));
    let deflated = put(&put(&bytes, local + 8, &[8]), central + 10, &[8]);
    add("compressed_entry.usdz", Invalid, deflated);
    let size = u32::MAX - 1;
    add(
        "huge_entry.usdz",
        Invalid,
        put(&put(&bytes, central + 20, &size.to_le_bytes()), central + 24, &size.to_le_bytes()),
    );
    let locals = places(&bytes, b"PK\x01\x02");
    // The second entry at the place of the first.
    add("overlapping_entries.usdz", Invalid, put(&bytes, locals[1] + 42, &bytes[central + 42..central + 46]));
    add("wrong_checksum.usdz", Invalid, put(&bytes, central + 16, &[bytes[central + 16] ^ 1]));
}

fn ply_files(add: Add<'_>) {
    let (bytes, _) = ply::encode_ply(&small_scene(), &ply::PlyOptions::default()).expect("written");
    let end = places(&bytes, b"end_header\n")[0] + 11;
    let header = |from: &str, to: &str| [replaced(&bytes[..end], from, to), bytes[end..].to_vec()].concat();
    add("newer_version.ply", Invalid, header("little_endian 1.0", "little_endian 2.0"));
    add("big_endian.ply", Unsupported, header("binary_little_endian", "binary_big_endian"));
    add("list_property.ply", Unsupported, header("property float nx", "property list uchar int nx"));
    add("huge_count.ply", TooLarge, header("vertex 4", "vertex 99999999999"));
    add("count_beyond_the_end.ply", Invalid, header("vertex 4", "vertex 5"));
    add("count_beyond_all_numbers.ply", Invalid, header("vertex 4", "vertex 99999999999999999999999999"));
    add(
        "huge_element_before.ply",
        Invalid,
        header("element vertex", "element a 18446744073709551615\nproperty double b\nelement vertex"),
    );
    add("second_property.ply", Invalid, header("property float ny", "property float nx"));
    add(
        "odd_degree.ply",
        Unsupported,
        header("property float opacity\n", "property float opacity\nproperty float f_rest_0\n"),
    );
    let many = "element e 0\n".repeat(1030);
    add("many_elements.ply", TooLarge, header("element vertex", &format!("{many}element vertex")));
    add("nan.ply", Invalid, put(&bytes, end, &f32::NAN.to_le_bytes()));
    let row = (bytes.len() - end) / 4;
    add("no_quaternion.ply", Invalid, put(&bytes, end + row - 16, &[0; 16]));
    add("long_quaternion.ply", Reads, put(&bytes, end + row - 16, &7.0_f32.to_le_bytes()));
    add("bytes_behind.ply", Reads, [bytes.clone(), vec![0; 9]].concat());
    add("no_splats.ply", Reads, header("vertex 4", "vertex 0"));
    add(
        "not_of_splats.ply",
        Invalid,
        b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n".to_vec(),
    );
}

/// A file of splats that are all zeros.
pub fn zeros(num_splats: usize) -> Vec<u8> {
    let mut streams = Vec::new();
    for width in [9, 1, 3, 3, 4, 45] {
        let raw = width * num_splats;
        let piece = vec![0; raw.clamp(1, 1 << 24)];
        let frames = zstd::bulk::compress(&piece, 1).expect("compressed").repeat(raw.div_ceil(1 << 24));
        streams.push((frames, raw));
    }
    let mut bytes = b"NGSP".to_vec();
    bytes.extend([4, num_splats as u32].iter().flat_map(|w| w.to_le_bytes()));
    bytes.extend([3, 12, 0, 6, 32, 0, 0, 0]);
    bytes.resize(32, 0);
    for (frames, raw) in &streams {
        bytes.extend([frames.len(), *raw].iter().flat_map(|&w| (w as u64).to_le_bytes()));
    }
    bytes.extend(streams.into_iter().flat_map(|(frames, _)| frames));
    bytes
}

fn spz_files(add: Add<'_>) {
    let of_version = |version| {
        let options = spz::SpzOptions { version, ..spz::SpzOptions::default() };
        spz::encode_spz(&small_scene(), &options).expect("written").0
    };
    let in_gzip = of_version(spz::SpzVersion::V3);
    add("header_of_gzip_alone.spz", Invalid, vec![0x1f, 0x8b, 8, 0, 0, 0, 0, 0]);
    add("damaged_gzip.spz", Invalid, put(&in_gzip, in_gzip.len() - 20, &[0xff; 8]));
    add("extra_field_beyond_the_end.spz", Invalid, put(&in_gzip, 10, &[0xff; 2]));
    let meta = places(&in_gzip, b"{\"near\"")[0];
    add("damaged_extra_field.spz", Reads, put(&in_gzip, meta, b"["));
    add("long_subfield.spz", Reads, put(&in_gzip, meta - 2, &[0xff; 2]));
    let bytes = of_version(spz::SpzVersion::V4);
    add("newer_version.spz", Unsupported, put(&bytes, 4, &[5]));
    add("high_degree.spz", Unsupported, put(&bytes, 12, &[5]));
    add("huge_count.spz", TooLarge, put(&bytes, 8, &u32::MAX.to_le_bytes()));
    add("tables_beyond_the_end.spz", Invalid, put(&bytes, 16, &u32::MAX.to_le_bytes()));
    add("odd_fraction.spz", Invalid, put(&bytes, 13, &[31]));
    // Within the limit on memory, but from almost no bytes.
    add("bomb.spz", TooLarge, zeros(1 << 22));
    let meta = places(&bytes, b"{\"near\"")[0];
    add("damaged_metadata.spz", Reads, put(&bytes, meta, b"["));
    let frame = places(&bytes, b"\"scale\":3.7")[0];
    add("mirrored_frame.spz", Invalid, put(&bytes, frame, b"\"scale\":-37"));
}

/// A valid file of few splats on a page of this side, most of which nothing uses.
fn roomy_page(side: u32) -> Vec<u8> {
    let options =
        gltf::GltfOptions { quality: Quality::Balanced, page_side: 64, ..gltf::GltfOptions::default() };
    let (mut json, mut bin) = split(&gltf::encode_glb(&small_scene(), &options).expect("written"));
    let mut page = Vec::new();
    let mut encoder = png::Encoder::new(&mut page, side, side);
    encoder.set_color(png::ColorType::Rgb);
    let mut writer = encoder.write_header().expect("written");
    let mut rows = writer.stream_writer().expect("written");
    let row = vec![127; 3 * side as usize];
    (0..side).for_each(|_| std::io::Write::write_all(&mut rows, &row).expect("written"));
    rows.finish().expect("written");
    drop(writer);
    bin.resize(bin.len().next_multiple_of(4), 0);
    let view = json["images"][0]["bufferView"].as_u64().expect("a view") as usize;
    json["bufferViews"][view]["byteOffset"] = json!(bin.len());
    json["bufferViews"][view]["byteLength"] = json!(page.len());
    bin.extend(page);
    bin.resize(bin.len().next_multiple_of(4), 0);
    json["buffers"][0]["byteLength"] = json!(bin.len());
    at(&mut json, OURS)["atlas"][0]["width"] = json!(side);
    at(&mut json, OURS)["atlas"][0]["height"] = json!(side);
    join(&json, &bin)
}

/// Files that take as much memory or time as they can, by what they do.
pub fn greedy() -> Vec<(&'static str, String, Vec<u8>)> {
    let mut files = Vec::new();
    let mut add = |what, extension: &str, bytes| files.push((what, format!("greedy.{extension}"), bytes));
    add("splats of zeros", "spz", zeros(250_000));
    let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 rot_0 rot_1 rot_2 rot_3".split(' ');
    let names = names.map(str::to_owned).chain((0..45).map(|i| format!("f_rest_{i}")));
    let header: String = names.map(|name| format!("property char {name}\n")).collect();
    let header = format!("ply\nformat binary_little_endian 1.0\nelement vertex 10000\n{header}end_header\n");
    add("properties of a byte", "ply", [header.into_bytes(), vec![1; 58 * 10_000]].concat());
    let neutral = |side: u16| {
        let num_texels = usize::from(side) * usize::from(side);
        let mut asset = scene(1, 0);
        asset.maps[0] = AssetMap { rows: side, cols: side, texel_sizes: [0.001; 2], ..AssetMap::default() };
        asset.texels = vec![0.0; 3 * num_texels];
        asset
    };
    let options =
        gltf::GltfOptions { quality: Quality::Balanced, page_side: 2048, ..gltf::GltfOptions::default() };
    let glb = gltf::encode_glb(&neutral(2048), &options).expect("written");
    add("a page of neutral texels", "glb", glb);
    let lossless = ltgs::LtgsOptions { quality: Quality::Lossless, ..ltgs::LtgsOptions::default() };
    add("neutral texels", "ltgs", ltgs::encode(&neutral(1024), &lossless).expect("written"));
    add(
        "more neutral texels than any scene",
        "ltgs",
        ltgs::encode(&neutral(4096), &lossless).expect("written"),
    );
    let lossy = ltgs::LtgsOptions { quality: Quality::Tiny, ..ltgs::LtgsOptions::default() };
    add("rounded neutral texels", "ltgs", ltgs::encode(&neutral(2048), &lossy).expect("written"));
    for (name, bytes) in many_tags(400_000) {
        add(name, "html", bytes);
    }
    add("a page of 4096 for few texels", "glb", roomy_page(4096));
    add("a page of 8192 for few texels", "glb", roomy_page(8192));
    let (json, bin) = split(&gltf::encode_glb(&small_scene(), &options).expect("written"));
    let mut nodes = json.clone();
    nodes["nodes"].as_array_mut().expect("nodes").extend(vec![json!({}); 130_000]);
    add("JSON of empty nodes", "glb", join(&nodes, &bin));
    let mut numbers = json;
    numbers["nodes"][0]["children"] = json!(vec![0; 500_000]);
    add("JSON of numbers", "glb", join(&numbers, &bin));
    let usda = |body: String| format!("#usda 1.0\n(\n)\n{body}").into_bytes();
    add("text of prims", "usda", usda("def\"\"{}".repeat(50_000)));
    add(
        "text of properties",
        "usda",
        usda(format!("def \"a\"{{{}}}", (0..50_000).map(|i| format!("int a{i} ")).collect::<String>())),
    );
    add("text of numbers", "usda", usda(format!("def \"a\"{{double[] b=[{}0]}}", "0,".repeat(200_000))));
    let entries = format!("#usda 1.0\n(customLayerData={{{}}})", "int a=0 ".repeat(50_000));
    add("text of entries", "usda", entries.into_bytes());
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.usdz");
    let options = WriteOptions { quality: Quality::Balanced, ..WriteOptions::default() };
    write_asset(&path, &neutral(1024), &options).expect("written");
    add("a page of neutral texels", "usdz", std::fs::read(&path).expect("read"));
    files
}
