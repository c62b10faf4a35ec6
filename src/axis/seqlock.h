/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One writer hands a struct to any number of readers, who get it whole or try again. The struct
 * travels as atomic words: a release store of each word and an acquire load of each are enough for
 * a reader that saw any word of a new publication to see the odd sequence too, so no fence is needed
 * (ThreadSanitizer does not understand fences).
 *
 * The words array holds DB_SEQLOCK_WORDS(type) elements; everything starts as zero.
 */
#ifndef DRIVEBRIDGE_AXIS_SEQLOCK_H
#define DRIVEBRIDGE_AXIS_SEQLOCK_H

#include <sched.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define DB_SEQLOCK_WORDS(type) ((sizeof(type) + 3) / 4)

/* A writer that was preempted inside its publication needs the processor that a reader spins on. */
#define DB_SEQLOCK_SPINS 64

/* The one writer's thread only. */
static inline void db_seqlock_write(atomic_uint *sequence, _Atomic uint32_t *words,
                                    const void *source, size_t bytes)
{
	unsigned before = atomic_load_explicit(sequence, memory_order_relaxed);
	const unsigned char *from = source;

	atomic_store_explicit(sequence, before + 1, memory_order_relaxed);
	for (size_t at = 0; at < bytes; at += sizeof(uint32_t)) {
		size_t left = bytes - at;
		uint32_t word = 0;

		memcpy(&word, from + at, left < sizeof word ? left : sizeof word);
		atomic_store_explicit(&words[at / sizeof word], word, memory_order_release);
	}
	atomic_store_explicit(sequence, before + 2, memory_order_release);
}

/* Any thread. */
static inline void db_seqlock_read(const atomic_uint *sequence, const _Atomic uint32_t *words,
                                   void *target, size_t bytes)
{
	unsigned char *to = target;
	unsigned spins = 0;

	for (;;) {
		unsigned before = atomic_load_explicit(sequence, memory_order_acquire);

		for (size_t at = 0; at < bytes && !(before & 1); at += sizeof(uint32_t)) {
			size_t left = bytes - at;
			uint32_t word = atomic_load_explicit(&words[at / sizeof word],
			                                     memory_order_acquire);

			memcpy(to + at, &word, left < sizeof word ? left : sizeof word);
		}
		if (!(before & 1) && atomic_load_explicit(sequence, memory_order_relaxed) == before)
			return;
		if (++spins % DB_SEQLOCK_SPINS == 0)
			sched_yield();
	}
}

#endif
