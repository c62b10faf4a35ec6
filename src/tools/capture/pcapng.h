/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Traces of CAN as pcapng files: one interface of LINKTYPE_CAN_SOCKETCAN with times in
 * microseconds, and each frame with its direction and its words as a comment.
 */
#ifndef DRIVEBRIDGE_CAPTURE_PCAPNG_H
#define DRIVEBRIDGE_CAPTURE_PCAPNG_H

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>

/* Writes the headers of the file, for a bus of the service's description. False: a write failed, and
 * errno has the reason; also for the next one. */
bool db_capture_pcapng_begin(FILE *file, const json_t *bus);

/* What comes before the next frame. Starts as zeros. */
struct db_capture_pcapng {
	json_int_t missed; /* frames that are missing before it: added by the user */
	/* Private: records that are no frames, for the comment of the next frame. */
	char comment[2048];
};

/* The next record of a trace (of the interface's type Record) with its words; writes it if it is a
 * frame. Each record once, in their order. */
bool db_capture_pcapng_take(struct db_capture_pcapng *pcapng, const json_t *record,
                            const char *words, FILE *file);

#endif
