//! The server: a thread that accepts, and one for each connection, of which there are few at a time.

use super::connections::{Connections, Place};
use super::request;
use super::response::{self, Response, Status};
use super::shown::Shown;
use super::token::Token;
use litetex_exporters::html::{Page, Place as Origin};
use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Time that a client may leave a piece of the page, or of data, unread before the connection is cut. A page that decodes
/// while it loads takes its time.
const PAGE_TIME_MAX: Duration = Duration::from_secs(10);
const DATA_TIME_MAX: Duration = Duration::from_secs(60);

/// Pause after a connection could not be accepted, as when there are no file handles.
const PAUSE: Duration = Duration::from_millis(50);

/// Drawn in the tab of the page.
const ICON: &[u8] = br##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 16 16"><ellipse cx="8" cy="8" rx="7" ry="4" transform="rotate(-30 8 8)" fill="#e07a3f"/></svg>"##;

/// A running server; ends when dropped.
pub struct Server {
    inner: Arc<Inner>,
}

struct Inner {
    address: SocketAddr,
    token: Token,
    page: Page<'static>,
    policy: String,
    shown: Arc<Shown>,
    is_ended: AtomicBool,
}

impl Server {
    /// Serves on a port of the loopback interface; 0 takes any that is free.
    ///
    /// # Errors
    /// If the port is taken or threads cannot be started.
    pub fn start(port: u16, shown: Arc<Shown>) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        let page = Page::embedded();
        let inner = Arc::new(Inner {
            address: listener.local_addr()?,
            token: Token::random()?,
            policy: page.policy(Origin::Server),
            page,
            shown,
            is_ended: AtomicBool::new(false),
        });
        let serving = Arc::clone(&inner);
        std::thread::Builder::new().name("viewer".into()).spawn(move || serving.accept(&listener))?;
        Ok(Self { inner })
    }

    /// Address for the user's browser. It holds the token: who has the address may read what is shown.
    pub fn url(&self) -> String {
        format!("http://{}/#{}", self.inner.address, self.inner.token.as_str())
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.inner.is_ended.store(true, Ordering::SeqCst);
        // Wakes the thread that accepts.
        let _ = TcpStream::connect(self.inner.address);
    }
}

impl Inner {
    fn accept(self: &Arc<Self>, listener: &TcpListener) {
        let connections = Connections::default();
        for stream in listener.incoming() {
            if self.is_ended.load(Ordering::SeqCst) {
                return;
            }
            let Ok(mut stream) = stream else {
                std::thread::sleep(PAUSE);
                continue;
            };
            // Without room for it, or for its thread, a connection is closed.
            let Some(mut place) = connections.enter(&stream) else { continue };
            let serving = Arc::clone(self);
            let _ = std::thread::Builder::new().name("viewer connection".into()).spawn(move || {
                // Clients that go away are no one's problem.
                let _ = serving.serve(&mut stream, &mut place);
                response::close(&mut stream);
            });
        }
    }

    fn serve(&self, stream: &mut TcpStream, place: &mut Place) -> io::Result<()> {
        stream.set_write_timeout(Some(PAGE_TIME_MAX))?;
        stream.set_nodelay(true)?;
        match request::read(stream, self.address.port()) {
            Ok(request) => {
                place.answer();
                self.answer(&request.path, request.is_head, stream)
            }
            Err(Some(status)) => {
                place.answer();
                Response::refusal(status).write(stream, false)
            }
            Err(None) => Ok(()),
        }
    }

    fn answer(&self, path: &str, is_head: bool, stream: &mut TcpStream) -> io::Result<()> {
        let refuse = |status, stream: &mut TcpStream| Response::refusal(status).write(stream, is_head);
        match path {
            "/" => {
                let page = Response::of("text/html; charset=utf-8", self.page.html().as_bytes());
                return Response { policy: Some(&self.policy), ..page }.write(stream, is_head);
            }
            "/favicon.ico" => return Response::of("image/svg+xml", ICON).write(stream, is_head),
            _ => {}
        }
        let Some((token, what)) = path[1..].split_once('/') else { return refuse(Status::NotFound, stream) };
        if !self.token.is(token) {
            return refuse(Status::Forbidden, stream);
        }
        stream.set_write_timeout(Some(DATA_TIME_MAX))?;
        match what {
            "session.json" => {
                let session = self.shown.session(&format!("/{token}/"));
                let json = serde_json::to_vec(&session).map_err(io::Error::other)?;
                Response::of("application/json", &json).write(stream, is_head)
            }
            "asset" => match self.shown.asset().map(|bytes| bytes.open()) {
                Some(Ok((num_bytes, body))) => {
                    let empty = Response::of("application/octet-stream", &[]);
                    Response { num_bytes, body, ..empty }.write(stream, is_head)
                }
                Some(Err(_)) => refuse(Status::Failed, stream),
                None => refuse(Status::NotFound, stream),
            },
            _ => {
                let number = what.strip_prefix("photo/").filter(|n| n.bytes().all(|b| b.is_ascii_digit()));
                match number.and_then(|n| n.parse().ok()).and_then(|index| self.shown.photo(index)) {
                    Some(Ok(png)) => Response::of("image/png", &png).write(stream, is_head),
                    Some(Err(_)) => refuse(Status::Failed, stream),
                    None => refuse(Status::NotFound, stream),
                }
            }
        }
    }
}
