//! Connections: so many at once, and none that says nothing for long.

use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::serve::Listener;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Instant, Sleep, sleep, sleep_until};

/// Connections at once; more wait to be accepted. A process may hold 1024 files by default.
const CONNECTIONS: usize = 512;
/// A connection is closed after this time in which nothing was read or written; the stream of events has its heartbeat.
const QUIET: Duration = Duration::from_secs(120);

/// The listener.
pub struct Door {
    listener: TcpListener,
    slots: Arc<Semaphore>,
}

impl Door {
    /// Over a bound listener.
    pub fn new(listener: TcpListener) -> Door {
        Door { listener, slots: Arc::new(Semaphore::new(CONNECTIONS)) }
    }
}

impl Listener for Door {
    type Io = Line;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Line, SocketAddr) {
        loop {
            // The semaphore is never closed; without a permit there is no connection either.
            let Ok(permit) = self.slots.clone().acquire_owned().await else { continue };
            match self.listener.accept().await {
                Ok((stream, from)) => return (Line::new(stream, permit), from),
                // Out of files, or gone again: in a moment it may be otherwise.
                Err(_) => sleep(Duration::from_millis(50)).await,
            }
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

/// A connection.
pub struct Line {
    stream: TcpStream,
    last: Instant,
    alarm: Pin<Box<Sleep>>,
    _permit: OwnedSemaphorePermit,
}

impl Line {
    fn new(stream: TcpStream, permit: OwnedSemaphorePermit) -> Line {
        let last = Instant::now();
        // Small answers are not held back to be sent with later ones; where the system refuses, they merely come later.
        let _ = stream.set_nodelay(true);
        Line { stream, last, alarm: Box::pin(sleep_until(last + QUIET)), _permit: permit }
    }
}

impl AsyncRead for Line {
    fn poll_read(mut self: Pin<&mut Self>, cx: &mut Context<'_>, into: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        if let Poll::Ready(read) = Pin::new(&mut self.stream).poll_read(cx, into) {
            self.last = Instant::now();
            return Poll::Ready(read);
        }
        while self.alarm.as_mut().poll(cx).is_ready() {
            let due = self.last + QUIET;
            if Instant::now() >= due {
                return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
            }
            self.alarm.as_mut().reset(due);
        }
        Poll::Pending
    }
}

impl AsyncWrite for Line {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, from: &[u8]) -> Poll<io::Result<usize>> {
        self.last = Instant::now();
        Pin::new(&mut self.stream).poll_write(cx, from)
    }
    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }
    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}
