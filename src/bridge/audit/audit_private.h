/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The files of the audit trail for each other.
 */
#ifndef DRIVEBRIDGE_AUDIT_AUDIT_PRIVATE_H
#define DRIVEBRIDGE_AUDIT_AUDIT_PRIVATE_H

#include "drivebridge/audit.h"

#include <jansson.h>
#include <nettle/hmac.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

/* --- chain.c ---------------------------------------------------------------------------------- */

/*
 * What binds the lines of the trail together: each ends with a seal, the first half of an
 * HMAC-SHA256 over the seal of the line before and the line itself. A line that is changed, taken
 * out or put in does not fit those around it. Pure.
 */

#define DB_CHAIN_KEY 32
#define DB_SEAL_MAX 33 /* hexadecimal digits, terminated */

/* A longer line is none of the trail. */
#define DB_TRAIL_LINE_MAX 8192

struct db_chain {
	struct hmac_sha256_ctx hash; /* with the key */
	char seal[DB_SEAL_MAX];      /* of the line before */
};

enum db_chain_verdict { DB_CHAIN_GOOD, DB_CHAIN_WRONG, DB_CHAIN_NO_LINE };

void db_chain_init(struct db_chain *chain, const uint8_t key[DB_CHAIN_KEY]);

/* Room for the end of a line: its seal, and the rest of its object. */
#define DB_CHAIN_END_MAX (DB_SEAL_MAX + 16)

/* The end for a line whose JSON object, without its last brace, is `body`. */
void db_chain_seal(struct db_chain *chain, const char *body, size_t length,
                   char end[DB_CHAIN_END_MAX]);

/* A line, without its line end, is the next one. WRONG: it is a line, and its seal does not fit;
 * those after it are judged by the seal that it has. */
enum db_chain_verdict db_chain_check(struct db_chain *chain, const char *line, size_t length);

/* --- record.c --------------------------------------------------------------------------------- */

/* A record as the object in a line of the trail, and back. Pure, but for the names of users. */

/* Null: no memory. */
json_t *db_record_write(const struct db_audit_entry *entry);

/* Where the texts of a record are that was read: in the object, which must outlive it. False: it is
 * none that this version understands. `values` has room for the first parameter, whose type is not
 * in the object. */
bool db_record_read(const json_t *object, struct db_audit_entry *entry,
                    struct db_audit_value *values);

/* "anna", in words, as histories show it: "192.168.10.5 port 51234", "control, user anna". To be
 * freed; null: no memory. */
char *db_record_who(const json_t *object);

/* The fields of the journal for it, "NAME=value" each, to be freed one by one; returns their
 * number. */
#define DB_RECORD_FIELDS_MAX 12
size_t db_record_fields(const struct db_audit_entry *entry, const json_t *object,
                        char *fields[DB_RECORD_FIELDS_MAX]);

/* What it has by this name; "" and 0 if it has nothing. */
const char *db_record_text(const json_t *object, const char *key);
uint64_t db_record_number(const json_t *object, const char *key);

/* True if what it says was asked for was not done. */
bool db_record_is_refused(const json_t *object);

/* --- queue.c ---------------------------------------------------------------------------------- */

/* Records that wait for the thread, one after the other in one block of memory. Pure. */

#define DB_AUDIT_QUEUE_BYTES (128 * 1024)

struct db_audit_queue {
	size_t begin; /* of the oldest */
	size_t end;   /* behind the newest */
	size_t wrap;  /* where the records end that begin at `begin`, when `end` is before it */
	size_t count;
	_Alignas(8) unsigned char bytes[DB_AUDIT_QUEUE_BYTES];
};

/* One record out of the queue, with room for its texts. */
struct db_audit_taken {
	struct db_audit_entry entry;
	_Alignas(8) unsigned char rest[8192];
};

/* False: it finds no room. Texts that are too long are cut. */
bool db_audit_queue_put(struct db_audit_queue *queue, const struct db_audit_entry *entry);
bool db_audit_queue_take(struct db_audit_queue *queue, struct db_audit_taken *taken);

/* --- flood.c ---------------------------------------------------------------------------------- */

/*
 * What a client repeats: the first few of a kind within a minute are records, and the rest of them
 * is counted, each client by itself. Pure: time is passed in.
 */

#define DB_FLOOD_FIRST 3   /* of one kind: client, drive, command and result */
#define DB_FLOOD_CLIENT 60 /* of all kinds of a client */
/* Of what clients without a right are denied, all of them together: who has no right must not have
 * the means to push out what others did. */
#define DB_FLOOD_DENIED 30
#define DB_FLOOD_PERIOD_S 60
#define DB_FLOODS_MAX 128

struct db_flood {
	db_time since; /* 0: a free place */
	uint64_t subject;
	uint32_t passed;
	uint32_t counted;
	uint64_t last; /* number of the latest record that passed */
	bool whole;    /* of all kinds of a client */
	/* Of that record, for the one that has the count. */
	uint8_t address[16];
	uint16_t port;
	uint16_t command;
	uint8_t result; /* enum db_result */
	char drive[64];
	char login[DB_CLIENT_PROCESS_USER_MAX];
	char user[DB_CLIENT_USER_MAX];
	char from[DB_AUDIT_FROM_MAX];
};

struct db_floods {
	struct db_flood places[DB_FLOODS_MAX + 1]; /* the last one is not a client's */
};

/* True: it is a record of its own, and its number is to be noted in *place. */
bool db_floods_pass(struct db_floods *floods, const struct db_audit_entry *entry, db_time now,
                    struct db_flood **place);

/* The next count whose minute is over, with `all` any; its texts are valid until the next call.
 * False: there is none. */
bool db_floods_due(struct db_floods *floods, db_time now, bool all, struct db_audit_entry *entry);
db_time db_floods_next(const struct db_floods *floods);

/* --- lines.c ---------------------------------------------------------------------------------- */

/* Bytes of the trail's files, line by line. Pure. */

struct db_lines {
	struct db_chain chain;
	uint64_t number;  /* of the last record, 0: none yet */
	uint64_t segment; /* that the last head has, 0: none yet */
	uint64_t line;    /* in it */
	bool begun;       /* the seal of the line before is known */
};

/* `object` is null where the line is no record: the head of a file, or nothing that can be read.
 * `why` is null when the line belongs here. */
typedef void db_lines_fn(void *context, const struct db_lines *lines, json_t *object,
                         const char *text, size_t length, const char *why);

/* Returns the number of bytes of whole lines. */
size_t db_lines_read(struct db_lines *lines, const char *bytes, size_t length, db_lines_fn *take,
                     void *context);

/* --- trail.c ---------------------------------------------------------------------------------- */

/*
 * The files: segments of an eighth of the size each, the oldest of which go. Their names have
 * numbers; a segment begins with a line that says its number and the seal of the line before it.
 * The key is in a file beside them. One thread.
 */

#define DB_TRAIL_SEGMENTS 8

struct db_trail;

/* What was found when the trail was opened. */
struct db_trail_found {
	uint64_t cut;   /* bytes of a torn line at the end, which were cut off */
	bool fresh_key; /* there were files, and no key for them */
	bool wrong_end; /* the last record does not fit to the key, or to the one before */
};

/* 0 or a negative errno. The folder is made. */
int db_trail_open(const char *folder, uint64_t bytes, struct db_trail **trail,
                  struct db_trail_found *found);
void db_trail_free(struct db_trail *trail);
void db_trail_set_bytes(struct db_trail *trail, uint64_t bytes);

/* Number of the last record; 0: none. */
uint64_t db_trail_newest(const struct db_trail *trail);
uint64_t db_trail_bytes(const struct db_trail *trail);

/* Adds a record. 0 or a negative errno: then nothing was added. */
int db_trail_append(struct db_trail *trail, const json_t *object, uint64_t number,
                    uint64_t time_us);
/* What was added outlives a loss of power. 0 or a negative errno. */
int db_trail_sync(struct db_trail *trail);

/* Calls `take` with the lines of the last bytes, from the first whole one on. */
void db_trail_read_tail(struct db_trail *trail, size_t bytes, db_lines_fn *take, void *context);

/* A place from which the trail is read on. */
struct db_trail_place {
	uint64_t segment;
	uint64_t offset;
	struct db_lines lines;
};

/* The last place before the record of this number, and before those of this time. */
void db_trail_find(struct db_trail *trail, uint64_t number, uint64_t since_us,
                   struct db_trail_place *place);
/* Reads about this number of bytes. False: there are no more. */
bool db_trail_read(struct db_trail *trail, struct db_trail_place *place, size_t bytes,
                   db_lines_fn *take, void *context);
/* The name of a segment, as its file has it. */
void db_trail_name(uint64_t segment, char name[32]);

/* --- pages.c ---------------------------------------------------------------------------------- */

/* Pages of the trail for those who ask. One thread, the trail's. */

/* What a record was about whose end comes later: of each drive the latest ones. There are 247
 * drives at most. */
struct db_begun {
	uint64_t number; /* 0: none; a greater one is newer */
	char drive[64];
	char what[64];
	char who[160];
};
#define DB_BEGUN_MAX 512

/* Where the last page of a reader ended: the next one goes on there. */
struct db_reader_place {
	uint32_t reader;
	uint64_t number; /* of the next record; 0: none */
	uint64_t used;   /* a greater one is newer */
	struct db_trail_place at;
};
#define DB_READERS_MAX 8

/* All zero at first. */
struct db_pages {
	struct db_reader_place places[DB_READERS_MAX];
	uint64_t read; /* pages so far */
	struct db_begun begun[DB_BEGUN_MAX];
};

/* Without a trail (null) an empty page. Its records are to be freed. */
void db_pages_read(struct db_pages *pages, struct db_trail *trail, uint32_t reader,
                   const struct db_audit_query *query, struct db_audit_page *page);

#endif
