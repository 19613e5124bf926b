//! Reads a request and decides whether it comes from the user's own page.

use super::response::Status;
use std::io::{ErrorKind, Read};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Most bytes of a request, request line and headers together.
const HEAD_BYTES_MAX: usize = 8 << 10;

/// Most headers; browsers send about 15.
const HEADERS_MAX: usize = 64;

/// Time in which a whole request must arrive.
const TIME_MAX: Duration = Duration::from_secs(5);

/// A request that may be answered, if its path exists.
#[derive(Debug, PartialEq, Eq)]
pub struct Request {
    /// Without the query.
    pub path: String,
    /// HEAD: the answer is wanted without its body.
    pub is_head: bool,
}

/// Reads the head of a request.
///
/// # Errors
/// The status to answer with, or `None` if the connection is closed or broken.
pub fn read(stream: &mut TcpStream, port: u16) -> Result<Request, Option<Status>> {
    let began = Instant::now();
    let mut head = Vec::new();
    let mut buffer = [0; 2048];
    loop {
        let left = TIME_MAX.checked_sub(began.elapsed()).filter(|left| !left.is_zero());
        let left = left.ok_or(Some(Status::RequestTimeout))?;
        stream.set_read_timeout(Some(left)).map_err(|_| None)?;
        match stream.read(&mut buffer) {
            Ok(0) => return Err(None),
            Ok(count) => head.extend_from_slice(&buffer[..count]),
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                return Err(Some(Status::RequestTimeout));
            }
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Err(_) => return Err(None),
        }
        // Looked at whole each time: a request has at most a few pieces.
        if head.windows(4).any(|end| end == b"\r\n\r\n") {
            return parse(&head, port).map_err(Some);
        }
        if head.len() > HEAD_BYTES_MAX {
            return Err(Some(Status::HeadersTooLarge));
        }
    }
}

/// Parses the head of a request to the server on a port, and checks who makes it.
///
/// # Errors
/// The status to answer with.
pub fn parse(head: &[u8], port: u16) -> Result<Request, Status> {
    if head.len() > HEAD_BYTES_MAX {
        return Err(Status::HeadersTooLarge);
    }
    let mut headers = [httparse::EMPTY_HEADER; HEADERS_MAX];
    let mut parsed = httparse::Request::new(&mut headers);
    match parsed.parse(head) {
        Ok(httparse::Status::Complete(_)) => {}
        Err(httparse::Error::TooManyHeaders) => return Err(Status::HeadersTooLarge),
        Ok(httparse::Status::Partial) | Err(_) => return Err(Status::BadRequest),
    }
    let (Some(method), Some(target)) = (parsed.method, parsed.path) else { return Err(Status::BadRequest) };
    check_origin(parsed.headers, port)?;
    let is_head = match method {
        "GET" => false,
        "HEAD" => true,
        _ => return Err(Status::MethodNotAllowed),
    };
    if !target.starts_with('/') {
        return Err(Status::BadRequest);
    }
    let path = target.split('?').next().unwrap_or_default().to_owned();
    Ok(Request { path, is_head })
}

/// Refuses requests under another name than this server's (DNS rebinding), and those that other pages make.
fn check_origin(headers: &[httparse::Header<'_>], port: u16) -> Result<(), Status> {
    let names = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
    let is_name = |name: &[u8]| names.iter().any(|own| own.as_bytes() == name);
    let all = |wanted: &'static str| {
        let named = headers.iter().filter(move |h| h.name.eq_ignore_ascii_case(wanted));
        named.map(|h| h.value.trim_ascii())
    };
    let mut hosts = all("host");
    match (hosts.next(), hosts.next()) {
        (Some(host), None) if is_name(host) => {}
        (Some(_), None) => return Err(Status::Misdirected),
        _ => return Err(Status::BadRequest),
    }
    let is_own = |origin: &[u8]| origin.strip_prefix(b"http://").is_some_and(is_name);
    // Another port of this machine is another site's page: "same-site" is not enough.
    let is_direct = |site: &[u8]| matches!(site, b"same-origin" | b"none");
    if all("origin").all(is_own) && all("sec-fetch-site").all(is_direct) {
        return Ok(());
    }
    Err(Status::Forbidden)
}
