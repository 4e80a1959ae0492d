//! Serves a case on the loopback address until Enter is pressed: `cargo run --example serve_case -- leg.case.toml`.

use std::net::TcpListener;
use std::sync::mpsc::channel;

use ppa_studio::{Opening, Studio, serve};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let Some(case) = std::env::args_os().nth(1) else {
        println!("give a case that `ppa prepare` wrote");
        return Ok(());
    };
    let studio = Studio::open(&Opening::of(case.as_ref()))?;
    let listener = TcpListener::bind("127.0.0.1:0")?;
    println!("{}", studio.address(listener.local_addr()?));
    let (stop, stopped) = channel();
    std::thread::spawn(move || {
        let _ = std::io::stdin().read_line(&mut String::new());
        drop(stop);
    });
    Ok(serve(studio, listener, stopped)?)
}
