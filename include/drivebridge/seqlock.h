/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One writer passes a struct to any number of readers, which get it whole or try again. The struct
 * is copied as atomic words: a release store of each word and an acquire load of each are enough
 * for a reader that saw any word of a new publication to see the odd sequence too, so no fence is
 * needed (ThreadSanitizer does not understand fences).
 *
 * The words array holds DB_SEQLOCK_WORDS(type) elements; everything starts as zero.
 */
#ifndef DRIVEBRIDGE_SEQLOCK_H
#define DRIVEBRIDGE_SEQLOCK_H

#include <sched.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

typedef _Atomic unsigned long db_seqlock_word;

#define DB_SEQLOCK_WORDS_OF(bytes) \
	(((bytes) + sizeof(db_seqlock_word) - 1) / sizeof(db_seqlock_word))
#define DB_SEQLOCK_WORDS(type) DB_SEQLOCK_WORDS_OF(sizeof(type))

/* A writer that was preempted inside its publication needs the processor that a reader spins on. */
#define DB_SEQLOCK_SPINS 64

/* A publication in several pieces: begin, store each, end. The one writer's thread only. */
static inline void db_seqlock_begin(atomic_uint *sequence)
{
	unsigned before = atomic_load_explicit(sequence, memory_order_relaxed);

	atomic_store_explicit(sequence, before + 1, memory_order_relaxed);
}

static inline void db_seqlock_end(atomic_uint *sequence)
{
	unsigned before = atomic_load_explicit(sequence, memory_order_relaxed);

	atomic_store_explicit(sequence, before + 1, memory_order_release);
}

static inline void db_seqlock_store(db_seqlock_word *words, const void *source, size_t bytes)
{
	const unsigned char *from = source;
	size_t whole = bytes / sizeof(unsigned long);
	size_t rest = bytes % sizeof(unsigned long);
	unsigned long word;

	for (size_t i = 0; i < whole; i++) {
		memcpy(&word, from + i * sizeof word, sizeof word);
		atomic_store_explicit(&words[i], word, memory_order_release);
	}
	if (rest > 0) {
		word = 0;
		memcpy(&word, from + whole * sizeof word, rest);
		atomic_store_explicit(&words[whole], word, memory_order_release);
	}
}

/* A publication in one piece. */
static inline void db_seqlock_write(atomic_uint *sequence, db_seqlock_word *words,
                                    const void *source, size_t bytes)
{
	db_seqlock_begin(sequence);
	db_seqlock_store(words, source, bytes);
	db_seqlock_end(sequence);
}

static inline void db_seqlock_copy(const db_seqlock_word *words, void *target, size_t bytes)
{
	unsigned char *to = target;
	size_t whole = bytes / sizeof(unsigned long);
	size_t rest = bytes % sizeof(unsigned long);
	unsigned long word;

	for (size_t i = 0; i < whole; i++) {
		word = atomic_load_explicit(&words[i], memory_order_acquire);
		memcpy(to + i * sizeof word, &word, sizeof word);
	}
	if (rest > 0) {
		word = atomic_load_explicit(&words[whole], memory_order_acquire);
		memcpy(to + whole * sizeof word, &word, rest);
	}
}

/* Reading in pieces, any thread: wait until nothing is being published, copy each piece, and begin
 * again unless it is still the same publication. `spins` is 0 at first. */
static inline unsigned db_seqlock_wait(const atomic_uint *sequence, unsigned *spins)
{
	for (;;) {
		unsigned before = atomic_load_explicit(sequence, memory_order_acquire);

		if (++*spins % DB_SEQLOCK_SPINS == 0)
			sched_yield();
		if (!(before & 1))
			return before;
	}
}

static inline bool db_seqlock_is(const atomic_uint *sequence, unsigned before)
{
	return atomic_load_explicit(sequence, memory_order_relaxed) == before;
}

/* A publication in one piece. */
static inline void db_seqlock_read(const atomic_uint *sequence, const db_seqlock_word *words,
                                   void *target, size_t bytes)
{
	unsigned spins = 0;
	unsigned before;

	do {
		before = db_seqlock_wait(sequence, &spins);
		db_seqlock_copy(words, target, bytes);
	} while (!db_seqlock_is(sequence, before));
}

#endif
