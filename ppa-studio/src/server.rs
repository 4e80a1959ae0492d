//! Serving the page.

use std::net::TcpListener;
use std::sync::mpsc::Receiver;
use std::time::Duration;

use crate::error::StudioError;
use crate::studio::Studio;

/// Time for sending the last answers after a stop; a browser may never read its answer or finish its request.
const LAST_ANSWERS: Duration = Duration::from_secs(2);

/// Serves a studio until `stop` receives a message or loses its sender. Then finishes the current poses and files, and sends
/// answers for two more seconds.
///
/// # Errors
/// [`StudioError::Serve`] when the socket cannot be used.
pub fn serve(studio: Studio, listener: TcpListener, stop: Receiver<()>) -> Result<(), StudioError> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .max_blocking_threads(16)
        .enable_all()
        .build()
        .map_err(StudioError::Serve)?;
    let router = studio.router();
    let (ending, ended) = tokio::sync::oneshot::channel();
    let stopped = async move {
        let wait = move || {
            // A message and a lost sender mean the same.
            let _ = stop.recv();
            studio.stop();
        };
        let _ = tokio::task::spawn_blocking(wait).await;
        let _ = ending.send(());
    };
    let patience = async move {
        let _ = ended.await;
        tokio::time::sleep(LAST_ANSWERS).await;
    };
    let served = runtime.block_on(async {
        listener.set_nonblocking(true)?;
        let listener = tokio::net::TcpListener::from_std(listener)?;
        let serving = axum::serve(listener, router).with_graceful_shutdown(stopped);
        tokio::select! {
            served = serving.into_future() => served,
            () = patience => Ok(()),
        }
    });
    // Waits for work started by requests, such as writing a file.
    drop(runtime);
    served.map_err(StudioError::Serve)
}
