/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The service's background work on the disk: checking whether the configuration's files have
 * changed since they were read, whether an upgrade has replaced running code, and storing a copy of
 * the files that are in force. In a separate thread, because a disk may take seconds, and the
 * network thread runs the watchdogs. Internal to src/bridge/service; all functions are the network
 * thread's.
 */
#ifndef DRIVEBRIDGE_SERVICE_DISK_H
#define DRIVEBRIDGE_SERVICE_DISK_H

#include <stdbool.h>
#include <stdint.h>

struct db_config;
struct disk;

/* Work that may wait for the disk. */
struct disk_job {
	void (*work)(struct disk_job *job); /* on the disk's thread */
	void (*done)(struct disk_job *job); /* for who takes the news, to be called there */
};

/* The result of the checks. */
struct disk_news {
	struct disk_job *job;     /* it was worked on; null: the following */
	bool read;                /* the files may have changed; the following is about them */
	struct db_config *config; /* null: they are invalid */
	char *messages;           /* one line each; null: out of memory */
	bool kept;                /* a copy was to be written; see error */
	int error;                /* errno, 0: it was written */
	char *newer; /* running code that was replaced, see upgrade/upgrade.h; reported once. Null:
	                nothing */
};

/* Checks the files of the configuration at `path` twice a second, and stores copies in the file
 * `copy`; null: nowhere. `signature` is that of the files as they were read, see
 * db_config_signature(). 0 or a negative errno. */
int disk_new(const char *path, const char *copy, uint64_t signature, struct disk **disk);

/* Waits for a copy that is being written. Null is fine. */
void disk_free(struct disk *disk);

/* Readable when there are news. */
int disk_fd(const struct disk *disk);

/* False when there are none. The caller frees the contents of `news`. */
bool disk_take_news(struct disk *disk, struct disk_news *news);

/* The files with this signature were read elsewhere: only other files are news. */
void disk_expect(struct disk *disk, uint64_t signature);

/* Has a job worked on, which must stay until it is among the news or disk_free() has returned.
 * False: there is one already. */
bool disk_do(struct disk *disk, struct disk_job *job);

/* Replaces a file as a whole, by way of another name in its folder: a loss of power leaves the old
 * or the new text. 0 or an errno. Any thread. */
int disk_replace_file(const char *path, const char *written_to, const char *text);

/* Has a copy written, see db_config_load_with_copy(), and takes it over. Nothing is written if the
 * file has this content already. */
void disk_keep(struct disk *disk, char *copy);

#endif
