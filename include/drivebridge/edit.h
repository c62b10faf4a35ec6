/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Editing buses and drives over the control socket: the file of db_config_edited_path(), of which
 * the last ten texts are kept. What the service is asked for and what it answers. Network thread.
 */
#ifndef DRIVEBRIDGE_EDIT_H
#define DRIVEBRIDGE_EDIT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Longest text, in bytes: as JSON it fits into one message of the control socket. */
#define DB_EDIT_TEXT_MAX 24576
/* Number of former texts that are kept. */
#define DB_EDIT_FORMERS 10

enum db_edit_kind {
	DB_EDIT_READ,  /* the present text, or a former one */
	DB_EDIT_CHECK, /* what is wrong with a text, and what loading it would do; writes nothing */
	DB_EDIT_SET,   /* the same, and writes it when nothing is wrong; loads nothing */
};

struct db_edit_request {
	enum db_edit_kind kind;
	const char *text; /* of CHECK and SET; copied */
	/* of SET: the version that it was made from; another one now is an error */
	uint64_t version;
	uint32_t former; /* of READ: number of a former text; 0: the present one */
};

enum db_edit_end {
	DB_EDIT_DONE,
	DB_EDIT_WRONG,   /* the messages say what is wrong with the text; nothing was written */
	DB_EDIT_CHANGED, /* the files of the configuration are others than those of `version` */
	DB_EDIT_FAILED,  /* see `error`, an errno */
};

struct db_edit_former {
	uint32_t number;  /* counts up; larger ones are newer */
	uint64_t time_us; /* when it was written, since 1970-01-01 UTC */
};

/* What a reload would do to a bus (drive: null) or to a drive. Those that go on are not listed. */
struct db_edit_effect {
	const char *bus;
	const char *drive;
	const char *text;
	bool moves; /* the drive moves now */
};

/* Valid during the call that gets it. */
struct db_edit_answer {
	enum db_edit_kind kind;
	enum db_edit_end end;
	int error;
	const char *path;     /* of the edited file */
	uint64_t version;     /* of the configuration's files now */
	const char *messages; /* as of --check, one line each; "" for none */
	const char *text;     /* of READ */
	const char *change;   /* of a SET that was done: lines removed (-) and added (+) */
	const char *running;  /* of READ: what runs, with every value; null: no memory */
	struct db_edit_former formers[DB_EDIT_FORMERS]; /* of READ; the newest first */
	size_t former_count;
	const struct db_edit_effect *effects;
	size_t effect_count;
};

#endif
