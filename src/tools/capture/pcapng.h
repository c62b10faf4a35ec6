/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Traces as pcapng files: one interface with times in microseconds, and each frame with its
 * direction and its words as a comment.
 *
 * Of CAN the interface is of LINKTYPE_CAN_SOCKETCAN. Of a serial line it is of LINKTYPE_USER0, for
 * which packaging/wireshark/drivebridge.lua is the dissector, and every record is a packet, also an
 * event or an answer that did not come: a byte 1 (version of this form), one with the direction (0
 * none, 1 sent, 2 received), three texts, each after its length in two bytes, the high one first
 * (the family, the kind, the words), and the bytes of the line.
 */
#ifndef DRIVEBRIDGE_CAPTURE_PCAPNG_H
#define DRIVEBRIDGE_CAPTURE_PCAPNG_H

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>

/* Writes the headers of the file, for a bus of the service's description. False: a write failed,
 * and errno has the reason; also for the next one. */
bool db_capture_pcapng_begin(FILE *file, const json_t *bus);

/* What comes before the next frame. Starts as zeros. */
struct db_capture_pcapng {
	json_int_t missed; /* frames that are missing before it: added by the user */
	/* The family on a serial line: set by the user, and must outlive this; null: CAN. */
	const char *family;
	/* Private: of CAN, records that are no frames, for the comment of the next frame. */
	char comment[2048];
};

/* The next record of a trace (of the interface's type Record) with its words; writes it if it is a
 * frame. Each record once, in their order. */
bool db_capture_pcapng_take(struct db_capture_pcapng *pcapng, const json_t *record,
                            const char *words, FILE *file);

#endif
