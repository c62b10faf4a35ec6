/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the service asks of the disk without having been asked: whether the configuration's files are others than those
 * that it read, and keeping a copy of those that are in force. In a thread of its own, because a disk may take seconds,
 * and the network thread runs the watchdogs. Internal to src/service; all functions are the network thread's.
 */
#ifndef DRIVEBRIDGE_SERVICE_DISK_H
#define DRIVEBRIDGE_SERVICE_DISK_H

#include <stdbool.h>
#include <stdint.h>

struct db_config;
struct disk;

/* What was found. */
struct disk_news {
	bool read;                /* the files are others; what follows is about them */
	struct db_config *config; /* null: they are wrong */
	char *messages;           /* a line each; null: out of memory */
	bool kept;                /* a copy was to be written; error says what came of it */
	int error;                /* errno, 0: it is there */
};

/* Looks at the files of the configuration at `path` twice a second, and keeps copies in the file `copy`; null: nowhere.
 * `signature` is that of the files as they were read, see db_config_signature(). 0 or a negative errno. */
int disk_new(const char *path, const char *copy, uint64_t signature, struct disk **disk);

/* Waits for a copy that is being written. Null is fine. */
void disk_free(struct disk *disk);

/* Readable when there are news. */
int disk_fd(const struct disk *disk);

/* False when there are none. What `news` has is the caller's to free. */
bool disk_take_news(struct disk *disk, struct disk_news *news);

/* The files with this signature were read elsewhere: news come of others only. */
void disk_expect(struct disk *disk, uint64_t signature);

/* Has a copy written, see db_config_load_with_copy(), which is taken over. Where it is there already nothing is written. */
void disk_keep(struct disk *disk, char *copy);

#endif
