//! What a command may take of the machine: threads and memory.

use clap::Args;

use crate::limits::{memory_limit, parse_size, set_memory_limit};

/// Threads beyond this many are a typing error.
const MOST_THREADS: i64 = 1024;

/// Threads and memory, of every command.
#[derive(Debug, Clone, Copy, Args)]
#[command(next_help_heading = "Resources")]
pub(crate) struct Resources {
    /// Number of threads; results do not depend on it [default: RAYON_NUM_THREADS, or the number of cores]
    #[arg(
        long,
        global = true,
        alias = "jobs",
        value_name = "N",
        value_parser = clap::value_parser!(u16).range(1..=MOST_THREADS)
    )]
    threads: Option<u16>,
    /// Largest memory to use, such as 8G; a request that needs more fails at once [default: INNOVANT_MEMORY, or half of the
    /// machine's memory]
    #[arg(long, global = true, value_name = "SIZE", value_parser = parse_size)]
    memory_limit: Option<u64>,
}

impl Resources {
    /// Makes them those of this process.
    ///
    /// # Errors
    /// The threads cannot be started, or `INNOVANT_MEMORY` is no size.
    pub(crate) fn apply(self) -> anyhow::Result<()> {
        if let Some(threads) = self.threads {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into());
            pool.build_global().map_err(|error| {
                anyhow::anyhow!(
                    "{threads} threads cannot be started: {error}; ask for fewer with --threads"
                )
            })?;
        }
        if let Some(bytes) = self.memory_limit {
            set_memory_limit(Some(bytes));
        }
        memory_limit()?;
        Ok(())
    }
}
