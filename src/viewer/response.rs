//! Writes responses. Every one closes its connection and carries the headers that keep other pages out.

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

/// Bytes that are written at a time.
const PIECE_BYTES: usize = 64 << 10;

/// Policy of everything but the page: nothing may be loaded, framed or run.
const NO_POLICY: &str = "default-src 'none'; frame-ancestors 'none'";

/// Time that a client has to take what was sent before the connection is cut, and bytes of its request that are read after
/// a refusal so that the refusal arrives.
const LINGER: Duration = Duration::from_millis(500);
const LINGER_BYTES: u64 = 256 << 10;

/// Status of a response.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    Ok,
    BadRequest,
    Forbidden,
    NotFound,
    MethodNotAllowed,
    RequestTimeout,
    Misdirected,
    HeadersTooLarge,
    Failed,
}

impl Status {
    fn line(self) -> &'static str {
        match self {
            Self::Ok => "200 OK",
            Self::BadRequest => "400 Bad Request",
            Self::Forbidden => "403 Forbidden",
            Self::NotFound => "404 Not Found",
            Self::MethodNotAllowed => "405 Method Not Allowed",
            Self::RequestTimeout => "408 Request Timeout",
            Self::Misdirected => "421 Misdirected Request",
            Self::HeadersTooLarge => "431 Request Header Fields Too Large",
            Self::Failed => "500 Internal Server Error",
        }
    }
}

/// A response.
pub struct Response<'a> {
    pub status: Status,
    /// Media type of the body.
    pub media_type: &'static str,
    /// Content-Security-Policy; `None`: nothing at all.
    pub policy: Option<&'a str>,
    /// Bytes of the body.
    pub num_bytes: u64,
    /// At least as many bytes.
    pub body: Box<dyn Read + 'a>,
}

impl<'a> Response<'a> {
    /// A response with bytes in memory.
    pub fn of(media_type: &'static str, bytes: &'a [u8]) -> Self {
        let num_bytes = bytes.len() as u64;
        Self { status: Status::Ok, media_type, policy: None, num_bytes, body: Box::new(bytes) }
    }

    /// A refusal, with its status as text.
    pub fn refusal(status: Status) -> Self {
        Self { status, ..Self::of("text/plain; charset=utf-8", status.line().as_bytes()) }
    }

    /// Writes it, without the body if only the head is wanted.
    ///
    /// # Errors
    /// Those of the connection, and of the body, after which the connection is to be cut: the client sees that bytes are missing.
    pub fn write(self, stream: &mut TcpStream, only_head: bool) -> io::Result<()> {
        let allow = if self.status == Status::MethodNotAllowed { "Allow: GET, HEAD\r\n" } else { "" };
        let head = format!(
            "HTTP/1.1 {}\r\nContent-Type: {}\r\nContent-Length: {}\r\nConnection: close\r\nCache-Control: no-store\r\n\
             Content-Security-Policy: {}\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n\
             Cross-Origin-Resource-Policy: same-origin\r\nCross-Origin-Opener-Policy: same-origin\r\n{allow}\r\n",
            self.status.line(),
            self.media_type,
            self.num_bytes,
            self.policy.unwrap_or(NO_POLICY)
        );
        stream.write_all(head.as_bytes())?;
        if !only_head {
            send(self.body, self.num_bytes, stream)?;
        }
        stream.flush()
    }
}

/// Copies exactly this many bytes.
fn send(mut body: Box<dyn Read + '_>, num_bytes: u64, stream: &mut TcpStream) -> io::Result<()> {
    let mut piece = vec![0; PIECE_BYTES.min(num_bytes as usize)];
    let mut left = num_bytes;
    while left > 0 {
        let wanted = left.min(PIECE_BYTES as u64) as usize;
        body.read_exact(&mut piece[..wanted])?;
        stream.write_all(&piece[..wanted])?;
        left -= wanted as u64;
    }
    Ok(())
}

/// Ends a connection so that what was written arrives: a connection closed with unread bytes is reset. Takes [`LINGER`] at most.
pub fn close(stream: &mut TcpStream) {
    let end = Instant::now() + LINGER;
    let mut piece = vec![0; PIECE_BYTES];
    let mut read = 0;
    if stream.shutdown(Shutdown::Write).is_ok() {
        while read < LINGER_BYTES {
            // A client that sends on, byte by byte, gets no more time for it.
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() || stream.set_read_timeout(Some(left)).is_err() {
                break;
            }
            match stream.read(&mut piece) {
                Ok(0) | Err(_) => break,
                Ok(bytes) => read += bytes as u64,
            }
        }
    }
    let _ = stream.shutdown(Shutdown::Both);
}
