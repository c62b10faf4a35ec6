/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What threads that write files for others have in common: those of the log, the audit trail and
 * the health values.
 */
#ifndef DRIVEBRIDGE_WORKER_H
#define DRIVEBRIDGE_WORKER_H

#include <pthread.h>
#include <stdbool.h>
#include <time.h>

/* A lock that threads with real-time priority share with the worker: who holds it gets the priority
 * of who waits for it. 0 or a negative errno value; pthread_mutex_destroy() ends it. */
static inline int db_worker_init_lock(pthread_mutex_t *lock)
{
	pthread_mutexattr_t attributes;
	int error = pthread_mutexattr_init(&attributes);

	if (error != 0)
		return -error;
	error = pthread_mutexattr_setprotocol(&attributes, PTHREAD_PRIO_INHERIT);
	if (error == 0)
		error = pthread_mutex_init(lock, &attributes);
	pthread_mutexattr_destroy(&attributes);
	return -error;
}

/* Waits for the end of a worker that was told to end, one second at most. False: a call blocks it,
 * that of a disk or a pipe, and cannot be ended; the worker keeps its memory until the process
 * ends. */
static inline bool db_worker_join(pthread_t worker)
{
	struct timespec end;

	/* By the wall clock: thread sanitizer does not know the function for CLOCK_MONOTONIC. */
	clock_gettime(CLOCK_REALTIME, &end);
	end.tv_sec += 1;
	if (pthread_timedjoin_np(worker, NULL, &end) == 0)
		return true;
	pthread_detach(worker);
	return false;
}

#endif
