//! Threads that encode, hash and write chunks while the next ones are drawn.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

use super::super::pending::place;
use super::super::sum::Sum;
use super::SetPlan;
use crate::threads::{self, ThreadError};

/// Number of threads: one can hash while the other waits for the disk.
const THREADS: usize = 2;

/// A chunk of columns as they were delivered.
pub(super) struct Chunk {
    pub(super) index: u64,
    pub(super) columns: Vec<Vec<u8>>,
}

/// Result of writing a chunk. Its columns come back, for the next chunk to reuse their memory.
pub(super) struct Done {
    pub(super) chunk: Chunk,
    pub(super) written: io::Result<Vec<Sum>>,
}

pub(super) struct Pool {
    queue: Option<SyncSender<Chunk>>,
    pub(super) done: Receiver<Done>,
    threads: Vec<JoinHandle<()>>,
    /// Set once waiting chunks are to be dropped.
    stopped: Arc<AtomicBool>,
}

impl Pool {
    /// Starts threads that write the chunks of a set in the folder `root`.
    pub(super) fn new(plan: &Arc<SetPlan>, root: &Path) -> Result<Pool, ThreadError> {
        // One waits: with one being filled and one a thread, that bounds the memory to four.
        let (queue, chunks) = sync_channel(1);
        let (finished, done) = channel();
        let chunks = Arc::new(Mutex::new(chunks));
        let stopped = Arc::new(AtomicBool::new(false));
        let threads = (0..THREADS).map(|_| {
            let worker = Worker {
                plan: plan.clone(),
                root: root.to_owned(),
                chunks: chunks.clone(),
                finished: finished.clone(),
                stopped: stopped.clone(),
            };
            threads::spawn(move || worker.run())
        });
        // Should the second not start, the first ends as its queue is gone.
        Ok(Pool { queue: Some(queue), done, threads: threads.collect::<Result<_, _>>()?, stopped })
    }

    /// Hands over a chunk; waits where others are waiting already.
    pub(super) fn submit(&self, chunk: Chunk) {
        let queue = self.queue.as_ref().expect("the pool is not being closed");
        queue.send(chunk).expect("the threads wait for chunks until the queue is closed");
    }

    /// Waits for the chunks that are being written, and drops those that wait.
    pub(super) fn stop(&mut self) {
        self.stopped.store(true, Ordering::Relaxed);
        self.close();
    }

    /// Waits for all submitted chunks.
    pub(super) fn close(&mut self) {
        self.queue = None;
        self.threads.drain(..).for_each(|thread| thread.join().expect("writing does not panic"));
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        self.stop();
    }
}

struct Worker {
    plan: Arc<SetPlan>,
    root: PathBuf,
    chunks: Arc<Mutex<Receiver<Chunk>>>,
    finished: Sender<Done>,
    stopped: Arc<AtomicBool>,
}

impl Worker {
    fn run(self) {
        loop {
            let chunk = self.chunks.lock().expect("no holder panics").recv();
            let Ok(chunk) = chunk else { return };
            if self.stopped.load(Ordering::Relaxed) {
                continue;
            }
            let written = self.write(&chunk);
            if self.finished.send(Done { chunk, written }).is_err() {
                return; // nobody wants to know
            }
        }
    }

    fn write(&self, chunk: &Chunk) -> io::Result<Vec<Sum>> {
        let parts = self.plan.layout.encode(&self.plan, chunk.index, &chunk.columns)?;
        parts
            .iter()
            .map(|part| {
                place(&self.root.join(&part.name), &part.bytes)?;
                Ok(part.sum())
            })
            .collect()
    }
}
