//! `cobake view`: bakes as a page, written to a file or served to this machine.

use std::io::{self, BufRead, BufReader, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context;
use clap::Args;
use cobake::error::Error;
use cobake::export::write_whole;

use super::{files, terminal};

/// How long a browser may take to ask, or to take the page.
const PATIENCE: Duration = Duration::from_secs(10);

/// The words after `view`.
#[derive(Args, Debug)]
pub(crate) struct ViewArgs {
    /// A file that `cobake bake` wrote
    #[arg(value_name = "A")]
    a: PathBuf,

    /// Another bake of the same scene, to be looked at beside A
    #[arg(value_name = "B")]
    b: Option<PathBuf>,

    /// Write the page to this file instead of serving it; it needs nothing but itself
    #[arg(long, value_name = "PAGE.html")]
    out: Option<PathBuf>,

    /// Where to serve the page on 127.0.0.1; 0 takes a free port
    #[arg(long, value_name = "PORT", default_value_t = 0, conflicts_with = "out")]
    port: u16,

    /// Which of the files' scenes to show [default: their default scene]
    #[arg(long, value_name = "INDEX")]
    scene: Option<usize>,
}

/// Runs the command. A page that is served is served until the program is ended.
pub(crate) fn run(args: &ViewArgs) -> anyhow::Result<()> {
    let inputs: Vec<_> = std::iter::once(&args.a).chain(&args.b).map(PathBuf::as_path).collect();
    if let Some(out) = &args.out {
        files::check_result("the page", out, &inputs)?;
    }
    let page = cobake::view::page(&args.a, args.b.as_deref(), args.scene)?;
    match &args.out {
        Some(out) => Ok(write_whole(out, page.as_bytes()).map_err(Error::from)?),
        None => serve(args.port, &page),
    }
}

fn serve(port: u16, page: &str) -> anyhow::Result<()> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))
        .with_context(|| format!("cannot listen on 127.0.0.1:{port}; give --port another number, or 0"))?;
    let address = listener.local_addr().context("cannot tell where the page is served")?;
    terminal::answer(&format!("http://{address}/\n")).context("cannot write to stdout")?;
    for stream in listener.incoming() {
        // A browser that goes away while it is answered is no reason to stop.
        let _ = stream.and_then(|stream| answer(&stream, page));
    }
    Ok(())
}

/// Answers one request: the page, whatever the query, or that there is nothing else.
fn answer(stream: &TcpStream, page: &str) -> io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let mut lines = BufReader::new(io::Read::take(stream, 1 << 16)).lines();
    let first = lines.next().transpose()?.unwrap_or_default();
    // A connection that is closed on unread words may lose the answer.
    for line in lines {
        if line?.is_empty() {
            break;
        }
    }
    let mut words = first.split(' ');
    let (method, target) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    let (status, kind, body) = match (method, target.split('?').next()) {
        ("GET" | "HEAD", Some("/")) => ("200 OK", "text/html; charset=utf-8", page),
        ("GET" | "HEAD", _) => ("404 Not Found", "text/plain; charset=utf-8", "there is only /\n"),
        _ => ("405 Method Not Allowed", "text/plain; charset=utf-8", "only GET and HEAD\n"),
    };
    let mut stream = stream;
    write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nCache-Control: no-store\r\nConnection: close\r\n\r\n",
        body.len()
    )?;
    if method != "HEAD" {
        stream.write_all(body.as_bytes())?;
    }
    stream.flush()
}
