/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Traces of CAN as pcapng files: one interface of LINKTYPE_CAN_SOCKETCAN with times in microseconds, and each frame with
 * its direction and its words as a comment.
 */
#ifndef DRIVEBRIDGE_CTL_PCAPNG_H
#define DRIVEBRIDGE_CTL_PCAPNG_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

/* The heads of the file. False: it could not be written, and errno says why; likewise the next. */
bool db_ctl_pcapng_begin(FILE *file, const char *interface, const char *description);

struct db_ctl_pcapng_frame {
	int64_t time_us; /* since 1970-01-01 UTC */
	bool sent;
	uint32_t id; /* with SocketCAN's flags */
	uint8_t data[8];
	uint8_t length;
	uint64_t missed;     /* frames lost before it */
	const char *comment; /* "": none */
};

bool db_ctl_pcapng_add(FILE *file, const struct db_ctl_pcapng_frame *frame);

#endif
