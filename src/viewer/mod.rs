//! A web server for one reader: it shows a scene in the user's own browser, and whatever else runs there must not read it.
//!
//! It listens on the loopback interface only, answers GET and HEAD, and addresses everything by number: no path from a client
//! reaches the file system. The page itself holds no data. Data are under a random token, which is in the fragment of the
//! address that the program prints, so that neither the page's requests to other hosts, of which there are none, nor a
//! `Referer` could carry it. Requests with another host's name (DNS rebinding), or that another page makes, are refused.
//!
//! Knows nothing of runs, models or the command line: callers fill a [`Shown`].

mod connections;
mod request;
mod response;
mod server;
mod shown;
#[cfg(test)]
mod tests;
mod token;

pub use server::Server;
pub use shown::{AssetBytes, Photos, Shown};
