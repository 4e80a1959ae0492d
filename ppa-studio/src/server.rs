//! Serving the page.

use std::net::TcpListener;
use std::sync::mpsc::Receiver;

use crate::error::StudioError;
use crate::studio::Studio;

/// Serves a studio until `stop` receives something or loses its sender, the poses under way are finished and the answers under way are sent.
///
/// # Errors
/// [`StudioError::Serve`] when the socket cannot be used.
pub fn serve(studio: Studio, listener: TcpListener, stop: Receiver<()>) -> Result<(), StudioError> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .max_blocking_threads(16)
        .enable_io()
        .build()
        .map_err(StudioError::Serve)?;
    let router = studio.router();
    let stopped = async move {
        let wait = move || {
            // Both ends of the channel mean the same.
            let _ = stop.recv();
            studio.stop();
        };
        let _ = tokio::task::spawn_blocking(wait).await;
    };
    let served = runtime.block_on(async {
        listener.set_nonblocking(true)?;
        let listener = tokio::net::TcpListener::from_std(listener)?;
        axum::serve(listener, router)
            .with_graceful_shutdown(stopped)
            .await
    });
    served.map_err(StudioError::Serve)
}
