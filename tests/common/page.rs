//! A server of the program as a child process, and raw requests to it.

use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// For whatever a busy machine takes long to do.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// Status, headers in lower case, body.
pub struct Answer {
    pub status: u16,
    pub headers: String,
    pub body: Vec<u8>,
}

impl Answer {
    pub fn header(&self, name: &str) -> Option<&str> {
        let mut lines = self.headers.lines().filter_map(|line| line.split_once(": "));
        lines.find(|(found, _)| found.eq_ignore_ascii_case(name)).map(|(_, value)| value)
    }
}

/// A server; killed when dropped.
pub struct Page {
    pub child: Child,
    /// As printed.
    pub url: String,
    /// `127.0.0.1:PORT`
    pub address: String,
    pub token: String,
}

impl Page {
    /// Starts a command that prints the address of its page first.
    pub fn start(args: &[&str]) -> Self {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin("litetex"));
        let child = command.args(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
        let mut child = child.unwrap();
        let mut url = String::new();
        BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut url).unwrap();
        let url = url.trim().to_owned();
        let parts = url.strip_prefix("http://").and_then(|rest| rest.split_once("/#"));
        let Some((address, token)) = parts else {
            let mut message = String::new();
            child.stderr.take().unwrap().read_to_string(&mut message).unwrap();
            panic!("{args:?}: no address in {url:?}: {message}");
        };
        let (address, token) = (address.to_owned(), token.to_owned());
        Self { child, url, address, token }
    }

    pub fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream
    }

    /// Sends a request as it is.
    pub fn raw(&self, request: &str) -> Answer {
        let mut stream = self.connect();
        // A server that refuses early closes before all is sent.
        let _ = stream.write_all(request.as_bytes());
        let mut all = Vec::new();
        stream.read_to_end(&mut all).unwrap();
        let end = all.windows(4).position(|end| end == b"\r\n\r\n").expect("the end of the headers");
        let head = String::from_utf8(all[..end].to_vec()).unwrap();
        let (line, headers) = head.split_once("\r\n").unwrap();
        let status = line.split(' ').nth(1).unwrap().parse().unwrap();
        Answer { status, headers: headers.to_owned(), body: all[end + 4..].to_vec() }
    }

    /// A request as the page makes it, with more headers, each ended by a line break.
    pub fn request(&self, method: &str, path: &str, headers: &str) -> Answer {
        self.raw(&format!("{method} {path} HTTP/1.1\r\nHost: {}\r\n{headers}\r\n", self.address))
    }

    /// What lies under the token.
    pub fn data(&self, what: &str) -> Answer {
        self.request("GET", &format!("/{}/{what}", self.token), "Sec-Fetch-Site: same-origin\r\n")
    }

    pub fn session(&self) -> Value {
        let answer = self.data("session.json");
        assert_eq!(answer.status, 200);
        serde_json::from_slice(&answer.body).unwrap()
    }

    /// The first session that is as wanted.
    pub fn wait_for(&self, what: &str, is_wanted: impl Fn(&Value) -> bool) -> Value {
        let began = Instant::now();
        loop {
            let session = self.session();
            if is_wanted(&session) {
                return session;
            }
            assert!(began.elapsed() < PATIENCE, "{what}: {session}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Sends a signal, such as `INT`.
    #[cfg(unix)]
    pub fn signal(&self, name: &str) {
        let id = self.child.id().to_string();
        assert!(Command::new("kill").args([&format!("-{name}"), &id]).status().unwrap().success());
    }

    /// Waits until it ends; its exit code and what it wrote to standard error.
    pub fn end(mut self) -> (Option<i32>, String) {
        let mut message = String::new();
        self.child.stderr.take().unwrap().read_to_string(&mut message).unwrap();
        (self.child.wait().unwrap().code(), message)
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
