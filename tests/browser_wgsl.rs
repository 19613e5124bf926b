//! Every kernel compiles in a browser: Tint is stricter than naga, especially about uniform control flow. A page in
//! headless Chromium compiles the kernels on its software driver and posts the messages.
#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use litetex_gs::gpu::web_shaders;
use serde::Deserialize;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::process::{Command, Stdio};
use std::sync::{Arc, mpsc};
use std::time::Duration;

const BROWSERS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
const FLAGS: [&str; 7] = [
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu-sandbox",
    "--no-first-run",
    "--enable-unsafe-webgpu",
    "--enable-features=Vulkan",
    "--use-webgpu-adapter=swiftshader",
];
/// Needed 28 s on two busy cores, before tiles of both heights were compiled; with every kernel compiled twice,
/// 120 s on two cores shared with four other jobs.
const TIMEOUT: Duration = Duration::from_secs(300);

#[derive(Deserialize)]
struct Report {
    /// The driver.
    adapter: Option<String>,
    /// Why there is no driver.
    why: Option<String>,
    results: Option<Vec<Compiled>>,
}

#[derive(Deserialize)]
struct Compiled {
    name: String,
    messages: Vec<Message>,
    /// Why creating the pipeline failed; empty if it succeeded.
    pipeline: String,
}

#[derive(Deserialize)]
struct Message {
    #[serde(rename = "type")]
    kind: String,
    line: u32,
    text: String,
}

/// Serves one request; sends the body of a report to `reports`.
fn answer(mut stream: TcpStream, shaders: &str, reports: &mpsc::Sender<String>) -> std::io::Result<()> {
    let mut reader = BufReader::new(stream.try_clone()?);
    let (mut request, mut length) = (String::new(), 0);
    reader.read_line(&mut request)?;
    loop {
        let mut header = String::new();
        if reader.read_line(&mut header)? == 0 || header.trim().is_empty() {
            break;
        }
        if let Some(value) = header.to_lowercase().strip_prefix("content-length:") {
            length = value.trim().parse().unwrap_or(0);
        }
    }
    let mut body = vec![0; length];
    reader.read_exact(&mut body)?;
    let page = include_str!("browser_wgsl.html");
    let (status, kind, text) = match request.split(' ').nth(1) {
        Some("/") => ("200 OK", "text/html", page),
        Some("/shaders") => ("200 OK", "application/json", shaders),
        Some("/report") => ("200 OK", "text/plain", ""),
        _ => ("404 Not Found", "text/plain", ""),
    };
    let length = text.len();
    write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{text}"
    )?;
    if request.contains(" /report ") {
        let _ = reports.send(String::from_utf8_lossy(&body).into_owned());
    }
    Ok(())
}

/// Compiles shaders, given by name, entry point and text, in a browser; or returns why that is not possible.
fn compile(shaders: &[(String, String, String)]) -> Result<Vec<Compiled>, String> {
    let shaders: Vec<_> = shaders
        .iter()
        .map(|(name, entry, text)| serde_json::json!({ "name": name, "entry_point": entry, "text": text }))
        .collect();
    let shaders: Arc<str> = serde_json::Value::Array(shaders).to_string().into();
    let listener = TcpListener::bind("127.0.0.1:0").map_err(|e| format!("no port: {e}"))?;
    let address = format!("http://{}/", listener.local_addr().unwrap());
    let (sender, receiver) = mpsc::channel();
    // The thread accepts connections until the process ends.
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            let (shaders, sender) = (shaders.clone(), sender.clone());
            std::thread::spawn(move || answer(stream, &shaders, &sender));
        }
    });
    let profile = tempfile::tempdir().unwrap();
    let log = profile.path().join("log.txt");
    let start = |browser: &&str| {
        Command::new(browser)
            .args(FLAGS)
            .arg(format!("--user-data-dir={}", profile.path().join("profile").display()))
            .arg(&address)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(std::fs::File::create(&log).unwrap())
            .spawn()
            .ok()
    };
    let mut browser = BROWSERS.iter().find_map(start).ok_or("Chromium is not installed")?;
    let report = receiver.recv_timeout(TIMEOUT);
    let _ = browser.kill();
    let _ = browser.wait();
    let report = report.map_err(|_| {
        let log = std::fs::read_to_string(&log).unwrap_or_default();
        format!("no report within {} s; log of the browser: {log}", TIMEOUT.as_secs())
    })?;
    let report: Report = serde_json::from_str(&report).map_err(|e| format!("{e} in {report}"))?;
    println!("adapter: {}", report.adapter.as_deref().unwrap_or("none"));
    report.results.ok_or_else(|| format!("no WebGPU in this browser: {}", report.why.unwrap_or_default()))
}

/// Errors of a shader, with positions given by `origin`.
fn errors(compiled: &Compiled, origin: impl Fn(u32) -> String) -> Vec<String> {
    let mut out: Vec<String> = compiled
        .messages
        .iter()
        .filter(|m| m.kind == "error")
        .map(|m| format!("{}: {}: {}", compiled.name, origin(m.line), m.text))
        .collect();
    if !compiled.pipeline.is_empty() {
        out.push(format!("{}: no pipeline: {}", compiled.name, compiled.pipeline));
    }
    out
}

#[test]
fn every_kernel_compiles_in_a_browser() {
    let kernels = web_shaders().unwrap();
    let mut shaders: Vec<_> =
        kernels.iter().map(|k| (k.name.clone(), k.entry_point.to_owned(), k.shader.text.clone())).collect();
    // Negative controls: a barrier in non-uniform control flow, and more buffers than WebGPU guarantees.
    let barrier = "@group(0) @binding(0) var<storage, read_write> x: array<u32>;\n\
        @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32) {\n\
        if (x[i] > 1u) { workgroupBarrier(); }\nx[i] = 1u; }";
    let buffers: String =
        (0..11).map(|i| format!("@group(0) @binding({i}) var<storage> b{i}: u32;\n")).collect();
    let sum = (0..11).map(|i| format!("b{i}")).collect::<Vec<_>>().join(" + ");
    let buffers = format!("{buffers}@compute @workgroup_size(1) fn main() {{ let sum = {sum}; }}");
    shaders.push(("barrier".into(), "main".into(), barrier.into()));
    shaders.push(("buffers".into(), "main".into(), buffers));
    let compiled = match compile(&shaders) {
        Ok(compiled) => compiled,
        Err(why) => {
            assert!(std::env::var_os("LITETEX_REQUIRE_BROWSER").is_none(), "{why}");
            println!("skipped: {why}");
            return;
        }
    };
    assert_eq!(compiled.len(), shaders.len());
    for variant in ["raster_bwd SCATTER", "raster_bwd HALF_TILES", "raster_fwd BATCHED"] {
        assert!(kernels.iter().any(|k| k.name == variant), "{variant} is not compiled");
    }
    assert!(kernels.iter().all(|k| k.name != "sort_scan HALF_TILES"), "sort_scan does not use tiles");
    let mut wrong = Vec::new();
    for (kernel, compiled) in kernels.iter().zip(&compiled) {
        assert_eq!(kernel.name, compiled.name);
        wrong.extend(errors(compiled, |line| kernel.shader.origin(line)));
        for message in compiled.messages.iter().filter(|m| m.kind != "error") {
            println!("{}: {} {}", kernel.name, kernel.shader.origin(message.line), message.text);
        }
    }
    let [barrier, buffers] = &compiled[kernels.len()..] else { panic!("the controls are missing") };
    let control = errors(barrier, |line| format!("control:{line}"));
    assert!(
        control.iter().any(|e| e.contains("control:3") && e.contains("uniform control flow")),
        "{control:?}"
    );
    assert!(!errors(buffers, |_| String::new()).is_empty(), "11 buffers were accepted");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
