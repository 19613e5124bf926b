//! Which requests are answered, and what a session tells. Whole exchanges are in `tests/cli_view.rs`.

use super::connections::Connections;
use super::request::{Request, parse};
use super::response::Status;
use super::token::Token;
use super::{AssetBytes, Photos, Shown};
use litetex_exporters::html::{SessionAsset, SessionPhoto, SessionTraining, TrainingState};
use std::io::{self, Read};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::time::Duration;

const PORT: u16 = 7000;

fn get(headers: &str) -> Result<Request, Status> {
    parse(format!("GET /a?b HTTP/1.1\r\n{headers}\r\n").as_bytes(), PORT)
}

#[test]
fn only_direct_requests_under_the_own_name_are_answered() {
    let host = "Host: 127.0.0.1:7000\r\n";
    let own = Ok(Request { path: "/a".to_owned(), is_head: false });
    let with = |headers: &str| get(&format!("{host}{headers}"));
    for headers in [
        "",
        "Origin: http://127.0.0.1:7000\r\n",
        "origin: http://localhost:7000\r\nSec-Fetch-Site: same-origin\r\n",
        "Sec-Fetch-Site: none\r\n",
    ] {
        assert_eq!(with(headers), own, "{headers}");
    }
    assert_eq!(get("Host: localhost:7000\r\n"), own);
    for headers in [
        "Origin: http://evil.example\r\n",
        "Origin: null\r\n",
        "Origin: https://127.0.0.1:7000\r\n",
        "Origin: http://127.0.0.1:7001\r\n",
        "Sec-Fetch-Site: cross-site\r\n",
        "Sec-Fetch-Site: same-site\r\n",
        "Sec-Fetch-Site: none\r\nSec-Fetch-Site: cross-site\r\n",
    ] {
        assert_eq!(with(headers), Err(Status::Forbidden), "{headers}");
    }
    for headers in [
        "Host: evil.example\r\n",
        "Host: evil.example:7000\r\n",
        "Host: 127.0.0.1\r\n",
        "Host: 127.0.0.1:7001\r\n",
        "Host: 127.0.0.1:7000.evil.example\r\n",
        "Host: 0.0.0.0:7000\r\n",
    ] {
        assert_eq!(get(headers), Err(Status::Misdirected), "{headers}");
    }
    assert_eq!(get(""), Err(Status::BadRequest));
    assert_eq!(with(host), Err(Status::BadRequest), "two names");
}

#[test]
fn requests_are_well_formed_and_small() {
    let with = |line: &str| parse(format!("{line}\r\nHost: localhost:7000\r\n\r\n").as_bytes(), PORT);
    assert_eq!(with("HEAD / HTTP/1.1"), Ok(Request { path: "/".to_owned(), is_head: true }));
    for method in ["POST", "PUT", "DELETE", "OPTIONS", "CONNECT", "get"] {
        assert_eq!(with(&format!("{method} / HTTP/1.1")), Err(Status::MethodNotAllowed), "{method}");
    }
    for line in ["GET http://localhost:7000/ HTTP/1.1", "GET * HTTP/1.1", "GET /", "", "GET / HTTP/9"] {
        assert_eq!(with(line), Err(Status::BadRequest), "{line}");
    }
    let many = "A: b\r\n".repeat(70);
    assert_eq!(get(&many), Err(Status::HeadersTooLarge));
    assert_eq!(get(&format!("A: {}\r\n", "b".repeat(9000))), Err(Status::HeadersTooLarge));
}

#[test]
fn tokens_are_random_and_compared_whole() {
    let [one, other] = [Token::random().unwrap(), Token::random().unwrap()];
    assert_eq!(one.as_str().len(), 32);
    assert!(one.is(one.as_str()) && !one.is(other.as_str()));
    assert!(!one.is("") && !one.is(&one.as_str()[1..]) && !one.is(&format!("{}0", one.as_str())));
}

struct NoPhotos;

impl Photos for NoPhotos {
    fn png(&self, index: usize) -> Option<io::Result<Vec<u8>>> {
        (index < 2).then(|| Err(io::Error::other("unreadable")))
    }
}

#[test]
fn a_session_counts_what_changes() {
    let shown = Shown::default();
    assert!(!shown.is_watched(Duration::from_secs(9)));
    let session = shown.session("/t/");
    assert!(session.asset.is_none() && session.photos.is_none() && session.training.is_none());
    assert!(shown.is_watched(Duration::from_secs(9)));
    for revision in 1..=2 {
        let bytes = AssetBytes::Memory(vec![revision as u8; 5].into());
        shown.set_asset("Title", SessionAsset { bytes: 5, ..SessionAsset::default() }, bytes);
        let session = shown.session("/t/");
        let asset = session.asset.unwrap();
        assert_eq!((asset.revision, asset.url.as_deref()), (revision, Some("/t/asset")));
        assert_eq!(session.title, "Title");
        let mut read = Vec::new();
        shown.asset().unwrap().open().unwrap().1.read_to_end(&mut read).unwrap();
        assert_eq!(read, [revision as u8; 5]);
    }
    let training = SessionTraining {
        step: 1,
        steps: 9,
        eta_secs: None,
        splats: 1,
        texels: 1,
        curve: vec![(1, 0.5)],
        curve_of: "loss".to_owned(),
        state: TrainingState::Running,
        revision: 0,
    };
    let told = |training: &SessionTraining| {
        shown.set_training(training.clone());
        shown.session("").training.unwrap().revision
    };
    let later = SessionTraining { step: 2, ..training.clone() };
    assert_eq!([told(&training), told(&training), told(&later)], [1, 1, 2]);
    let photo =
        |view: &str| SessionPhoto { view: view.to_owned(), url: String::new(), width_px: 1, height_px: 1 };
    assert!(shown.photo(0).is_none());
    shown.set_photos(vec![photo("a"), photo("b")], Arc::new(NoPhotos));
    assert_eq!(shown.session("/t/").photos.unwrap()[1].url, "/t/photo/1");
    assert!(shown.photo(1).unwrap().is_err() && shown.photo(2).is_none());
}

#[test]
fn the_connection_that_has_waited_longest_gives_way() {
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let connections = Connections::default();
    let (mut clients, mut accepted, mut places) = (Vec::new(), Vec::new(), Vec::new());
    let mut open = || {
        clients.push(TcpStream::connect(listener.local_addr().unwrap()).unwrap());
        accepted.push(listener.accept().unwrap().0);
        connections.enter(accepted.last().unwrap())
    };
    places.extend((0..33).map(|_| open().unwrap()));
    places.iter_mut().for_each(super::connections::Place::answer);
    // 33, of which the first was shut down: those that are answered stay, and there is room for no more.
    assert!(open().is_none());
    drop(places.pop());
    drop(places.pop());
    assert!(open().is_some());
    clients[0].set_read_timeout(Some(Duration::from_secs(9))).unwrap();
    assert_eq!(clients[0].read(&mut [0]).unwrap(), 0, "closed");
    clients[1].set_read_timeout(Some(Duration::from_millis(50))).unwrap();
    assert!(clients[1].read(&mut [0]).is_err(), "still open");
}
