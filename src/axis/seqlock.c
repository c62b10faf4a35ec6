/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/seqlock.h"

#include <sched.h>
#include <string.h>

void db_seqlock_write(atomic_uint *sequence, _Atomic uint32_t *words, const void *data, size_t bytes)
{
	unsigned before = atomic_load_explicit(sequence, memory_order_relaxed);
	const unsigned char *from = data;

	atomic_store_explicit(sequence, before + 1, memory_order_relaxed);
	for (size_t i = 0; i < bytes; i += sizeof(uint32_t)) {
		uint32_t word = 0;

		memcpy(&word, from + i, bytes - i < sizeof word ? bytes - i : sizeof word);
		/* Release: whoever sees this word also sees the odd sequence before it. */
		atomic_store_explicit(&words[i / sizeof word], word, memory_order_release);
	}
	atomic_store_explicit(sequence, before + 2, memory_order_release);
}

void db_seqlock_read(const atomic_uint *sequence, const _Atomic uint32_t *words, void *data,
                     size_t bytes)
{
	unsigned char *to = data;

	for (;;) {
		unsigned before = atomic_load_explicit(sequence, memory_order_acquire);

		for (size_t i = 0; i < bytes; i += sizeof(uint32_t)) {
			uint32_t word = atomic_load_explicit(&words[i / sizeof word],
			                                     memory_order_acquire);

			memcpy(to + i, &word, bytes - i < sizeof word ? bytes - i : sizeof word);
		}
		if (!(before & 1) &&
		    atomic_load_explicit(sequence, memory_order_relaxed) == before)
			return;
		/* The writer may wait for this very processor. */
		sched_yield();
	}
}
