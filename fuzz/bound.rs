//! The memory that a target may hold, whatever its bytes say: beyond it an allocation fails, which is a finding.

use std::alloc::System;

use cap::Cap;

/// Inputs stand for at most 2 MB of text or 200 samples of 4 channels. The largest thing that those ask for by themselves is
/// the factor of the longest past window that is chosen automatically, 250 samples: (251 x 4)^2 x 8 bytes = 8 MB, and a
/// few of that size at once (Gram matrix, scaled copy, factor; blocks of the jackknife).
const MOST_BYTES: usize = 256 << 20;

#[global_allocator]
static ALLOCATOR: Cap<System> = Cap::new(System, MOST_BYTES);
