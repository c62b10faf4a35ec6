/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The wire format of the control socket, which is varlink's: JSON objects, each ended by a zero
 * byte. Bytes are added in any portions, whole messages are returned.
 *
 * Pure: no I/O, no clock.
 */
#ifndef DRIVEBRIDGE_CLIENT_FRAMES_H
#define DRIVEBRIDGE_CLIENT_FRAMES_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

/* All 0 at first but for the limit. */
struct db_frames {
	size_t limit;    /* no message may be longer */
	char *bytes;     /* freed by the owner at the end */
	size_t size;     /* of the allocated memory */
	size_t begin;    /* of the message being received */
	size_t end;      /* of the bytes received */
	size_t searched; /* no zero byte before this position */
};

/* Appends received bytes. 0 or -ENOMEM. */
int db_frames_add(struct db_frames *frames, const void *bytes, size_t count);

/*
 * 1 with the next message, which the caller frees; 0 when none is complete; -EBADMSG when it is no
 * JSON object; -EMSGSIZE when it is longer than the limit.
 */
int db_frames_take(struct db_frames *frames, json_t **message);

/*
 * A call in its wire format; `size` includes its zero byte. `parameters` may be NULL and stays the
 * caller's. `flag`: "more", "oneway" or NULL. NULL without memory; freed with free().
 */
char *db_frames_write_call(const char *method, const json_t *parameters, const char *flag,
                           size_t *size);

#endif
