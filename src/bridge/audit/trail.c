/* SPDX-License-Identifier: Apache-2.0 */
#include "audit/audit_private.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#define KEY_NAME "key"
#define KEY_DIGITS (2 * DB_CHAIN_KEY)

/* Where the end of the last file is looked for: more than the longest line. */
#define TAIL_BYTES (4 * DB_TRAIL_LINE_MAX)

struct db_trail {
	int folder;
	uint64_t limit;
	struct db_chain chain;                /* for the next line */
	uint64_t number;                      /* of the last record */
	uint64_t segments[DB_TRAIL_SEGMENTS]; /* that are there, the oldest first */
	uint64_t sizes[DB_TRAIL_SEGMENTS];
	size_t count;
	int fd; /* of the last one; -1: none yet */
	bool unsynced;
	bool wrong_end; /* see struct db_trail_found */
};

void db_trail_name(uint64_t segment, char name[32])
{
	snprintf(name, 32, "trail-%08" PRIu64 ".jsonl", segment);
}

/* 0: it is none of the trail. */
static uint64_t segment_named(const char *name)
{
	uint64_t segment = 0;
	char right[32];

	if (sscanf(name, "trail-%20" SCNu64, &segment) != 1)
		return 0;
	db_trail_name(segment, right);
	return strcmp(name, right) == 0 ? segment : 0;
}

static int open_segment(const struct db_trail *trail, uint64_t segment, int flags)
{
	char name[32];

	db_trail_name(segment, name);
	return openat(trail->folder, name, flags | O_CLOEXEC | O_NOFOLLOW,
	              S_IRUSR | S_IWUSR | S_IRGRP);
}

static void drop_oldest(struct db_trail *trail)
{
	char name[32];

	db_trail_name(trail->segments[0], name);
	(void)unlinkat(trail->folder, name, 0);
	trail->count--;
	memmove(trail->segments, trail->segments + 1, trail->count * sizeof(trail->segments[0]));
	memmove(trail->sizes, trail->sizes + 1, trail->count * sizeof(trail->sizes[0]));
}

static void add_segment(struct db_trail *trail, uint64_t segment, uint64_t size)
{
	if (trail->count == DB_TRAIL_SEGMENTS)
		drop_oldest(trail);
	trail->segments[trail->count] = segment;
	trail->sizes[trail->count++] = size;
}

/* Until there is room for another segment. */
static void make_room(struct db_trail *trail)
{
	while (trail->count > 1 &&
	       (trail->count == DB_TRAIL_SEGMENTS ||
	        db_trail_bytes(trail) > trail->limit - trail->limit / DB_TRAIL_SEGMENTS))
		drop_oldest(trail);
}

/* --- the key ---------------------------------------------------------------------------------- */

static int read_key(const struct db_trail *trail, uint8_t key[DB_CHAIN_KEY])
{
	char digits[KEY_DIGITS + 1] = "";
	int fd = openat(trail->folder, KEY_NAME, O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
	ssize_t got;

	if (fd < 0)
		return -errno;
	got = read(fd, digits, KEY_DIGITS);
	close(fd);
	if (got != KEY_DIGITS)
		return -EINVAL;
	for (size_t i = 0; i < DB_CHAIN_KEY; i++) {
		unsigned byte;

		if (sscanf(digits + 2 * i, "%2x", &byte) != 1)
			return -EINVAL;
		key[i] = (uint8_t)byte;
	}
	explicit_bzero(digits, sizeof(digits));
	return 0;
}

/* Complete, or not there. */
static int make_key(const struct db_trail *trail, uint8_t key[DB_CHAIN_KEY])
{
	char digits[KEY_DIGITS + 1];
	bool good;
	int fd;

	if (getrandom(key, DB_CHAIN_KEY, 0) != DB_CHAIN_KEY)
		return -EIO;
	for (size_t i = 0; i < DB_CHAIN_KEY; i++)
		snprintf(digits + 2 * i, 3, "%02x", key[i]);
	fd = openat(trail->folder, KEY_NAME ".new", O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC,
	            S_IRUSR | S_IWUSR);
	if (fd < 0)
		return -errno;
	errno = ENOSPC;
	good = write(fd, digits, KEY_DIGITS) == KEY_DIGITS && fsync(fd) == 0;
	good = close(fd) == 0 && good;
	explicit_bzero(digits, sizeof(digits));
	if (!good || renameat(trail->folder, KEY_NAME ".new", trail->folder, KEY_NAME) != 0)
		return -errno;
	return 0;
}

/* --- opening ---------------------------------------------------------------------------------- */

static int compare(const void *a, const void *b)
{
	const uint64_t *x = a;
	const uint64_t *y = b;

	return *x < *y ? -1 : *x > *y;
}

static int list_segments(struct db_trail *trail)
{
	int fd = openat(trail->folder, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
	DIR *folder = fd < 0 ? NULL : fdopendir(fd);
	const struct dirent *file;
	uint64_t *found = NULL;
	size_t count = 0;
	int error = folder ? 0 : -errno;

	if (!folder && fd >= 0)
		close(fd);
	while (folder && error == 0 && (file = readdir(folder)) != NULL) {
		uint64_t segment = segment_named(file->d_name);
		uint64_t *more = segment ? realloc(found, (count + 1) * sizeof(*more)) : NULL;

		if (segment && !more)
			error = -ENOMEM;
		if (!more)
			continue;
		found = more;
		found[count++] = segment;
	}
	if (folder)
		closedir(folder);
	if (count > 0)
		qsort(found, count, sizeof(*found), compare);
	for (size_t i = 0; error == 0 && i < count; i++) {
		struct stat status = { .st_size = 0 };
		char name[32];

		db_trail_name(found[i], name);
		if (fstatat(trail->folder, name, &status, AT_SYMLINK_NOFOLLOW) == 0 &&
		    S_ISREG(status.st_mode))
			add_segment(trail, found[i], (uint64_t)status.st_size);
	}
	free(found);
	return error;
}

/* What is behind the last whole line is of a record that was being written when the power failed,
 * or the disk was full. */
static int cut_torn(struct db_trail *trail, uint64_t *cut)
{
	uint64_t *size = &trail->sizes[trail->count - 1];
	char bytes[TAIL_BYTES];
	uint64_t end = *size;

	while (end > 0) {
		size_t part = end < sizeof(bytes) ? (size_t)end : sizeof(bytes);
		ssize_t got = pread(trail->fd, bytes, part, (off_t)(end - part));
		const char *line_end = got > 0 ? memrchr(bytes, '\n', (size_t)got) : NULL;

		if (got != (ssize_t)part)
			return got < 0 ? -errno : -EIO;
		end -= part;
		if (!line_end)
			continue;
		end += (uint64_t)(line_end + 1 - bytes);
		break;
	}
	*cut += *size - end;
	if (end < *size && ftruncate(trail->fd, (off_t)end) != 0)
		return -errno;
	*size = end;
	return 0;
}

static void take_last(void *context, const struct db_lines *lines, json_t *object, const char *text,
                      size_t length, const char *why)
{
	struct db_trail *trail = context;

	(void)object;
	(void)text;
	(void)length;
	trail->wrong_end = why != NULL;
	memcpy(trail->chain.seal, lines->chain.seal, sizeof(trail->chain.seal));
	if (lines->number > trail->number)
		trail->number = lines->number;
}

/* The last segment that has a line is written on. */
static int open_last(struct db_trail *trail, uint64_t *cut)
{
	int error = 0;

	while (error == 0 && trail->count > 0 && trail->fd < 0) {
		char name[32];

		trail->fd = open_segment(trail, trail->segments[trail->count - 1],
		                         O_RDWR | O_APPEND);
		error = trail->fd < 0 ? -errno : cut_torn(trail, cut);
		if (error != 0 || trail->sizes[trail->count - 1] > 0)
			continue;
		/* It was begun, and its head was not written. */
		close(trail->fd);
		trail->fd = -1;
		db_trail_name(trail->segments[--trail->count], name);
		(void)unlinkat(trail->folder, name, 0);
	}
	/* A segment that has only its head has no number: that is in the one before. */
	if (error == 0 && trail->count > 0)
		db_trail_read_tail(trail, TAIL_BYTES, take_last, trail);
	return error;
}

static int open_files(struct db_trail *trail, const char *folder, struct db_trail_found *found)
{
	uint8_t key[DB_CHAIN_KEY];
	int error;

	if (mkdir(folder, S_IRWXU | S_IRGRP | S_IXGRP) != 0 && errno != EEXIST)
		return -errno;
	trail->folder = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
	if (trail->folder < 0)
		return -errno;
	error = list_segments(trail);
	if (error != 0)
		return error;
	error = read_key(trail, key);
	if (error == -ENOENT || error == -EINVAL) {
		found->fresh_key = trail->count > 0;
		error = make_key(trail, key);
	}
	if (error != 0)
		return error;
	db_chain_init(&trail->chain, key);
	explicit_bzero(key, sizeof(key));
	error = open_last(trail, &found->cut);
	/* A service that was killed may have left lines that are not on the disk yet. */
	trail->unsynced = true;
	found->wrong_end = trail->wrong_end && !found->fresh_key;
	return error;
}

int db_trail_open(const char *folder, uint64_t bytes, struct db_trail **trail,
                  struct db_trail_found *found)
{
	struct db_trail *made = calloc(1, sizeof(*made));
	int error;

	if (!made)
		return -ENOMEM;
	*found = (struct db_trail_found){ 0 };
	made->folder = made->fd = -1;
	made->limit = bytes;
	error = open_files(made, folder, found);
	if (error != 0) {
		db_trail_free(made);
		return error;
	}
	*trail = made;
	return 0;
}

void db_trail_free(struct db_trail *trail)
{
	if (!trail)
		return;
	if (trail->fd >= 0)
		close(trail->fd);
	if (trail->folder >= 0)
		close(trail->folder);
	explicit_bzero(&trail->chain, sizeof(trail->chain));
	free(trail);
}

void db_trail_set_bytes(struct db_trail *trail, uint64_t bytes)
{
	trail->limit = bytes;
	make_room(trail);
}

uint64_t db_trail_newest(const struct db_trail *trail)
{
	return trail->number;
}

uint64_t db_trail_bytes(const struct db_trail *trail)
{
	uint64_t bytes = 0;

	for (size_t i = 0; i < trail->count; i++)
		bytes += trail->sizes[i];
	return bytes;
}

/* --- writing ---------------------------------------------------------------------------------- */

/* All of it, or nothing: a part of a line is taken back. The chain goes on with it only if it was
 * written. */
static int write_line(struct db_trail *trail, json_t const *object)
{
	char line[DB_TRAIL_LINE_MAX + DB_CHAIN_END_MAX + 1];
	size_t length = json_dumpb(object, line, DB_TRAIL_LINE_MAX,
	                           JSON_COMPACT | JSON_REAL_PRECISION(9));
	uint64_t *size = &trail->sizes[trail->count - 1];
	char before[DB_SEAL_MAX];
	size_t written = 0;
	ssize_t part = 0;
	int error;

	if (length < 2 || length > DB_TRAIL_LINE_MAX - DB_CHAIN_END_MAX)
		return -EMSGSIZE;
	memcpy(before, trail->chain.seal, sizeof(before));
	length--;
	db_chain_seal(&trail->chain, line, length, line + length);
	length += strlen(line + length);
	line[length++] = '\n';
	while (written < length && (part = write(trail->fd, line + written, length - written)) > 0)
		written += (size_t)part;
	if (written == length) {
		*size += length;
		trail->unsynced = true;
		return 0;
	}
	error = part < 0 ? -errno : -ENOSPC;
	memcpy(trail->chain.seal, before, sizeof(before));
	/* What cannot be taken back is cut off by the next line that can be written. */
	if (written > 0)
		(void)!ftruncate(trail->fd, (off_t)*size);
	return error;
}

static int begin_segment(struct db_trail *trail, uint64_t number, uint64_t time_us)
{
	uint64_t segment = trail->count > 0 ? trail->segments[trail->count - 1] + 1 : 1;
	int former = trail->fd;
	json_t *head;
	/* What is not written on any more is not synced again. */
	int error = db_trail_sync(trail);
	int fd = error == 0 ? open_segment(trail, segment, O_RDWR | O_CREAT | O_TRUNC | O_APPEND) :
	                      -1;

	if (fd < 0)
		return error != 0 ? error : -errno;
	make_room(trail);
	add_segment(trail, segment, 0);
	trail->fd = fd;
	head = json_pack("{s:s, s:I, s:I, s:I, s:s}", "audit", "drivebridge 1", "segment",
	                 (json_int_t)segment, "first", (json_int_t)number, "time_us",
	                 (json_int_t)time_us, "before", trail->chain.seal);
	error = head ? write_line(trail, head) : -ENOMEM;
	json_decref(head);
	/* Its name, too, outlives a loss of power. */
	if (error == 0 && fsync(trail->folder) != 0)
		error = -errno;
	if (error == 0) {
		if (former >= 0)
			close(former);
		return 0;
	}
	/* An empty file is of no use: the former one is written on. */
	trail->fd = former;
	close(fd);
	trail->count--;
	return error;
}

int db_trail_append(struct db_trail *trail, const json_t *object, uint64_t number, uint64_t time_us)
{
	struct stat status;
	int error = 0;

	/* A part of a line that could not be taken back. */
	if (trail->fd >= 0 && fstat(trail->fd, &status) == 0 &&
	    (uint64_t)status.st_size != trail->sizes[trail->count - 1] &&
	    ftruncate(trail->fd, (off_t)trail->sizes[trail->count - 1]) != 0)
		return -errno;
	if (trail->fd < 0 ||
	    trail->sizes[trail->count - 1] + DB_TRAIL_LINE_MAX > trail->limit / DB_TRAIL_SEGMENTS)
		error = begin_segment(trail, number, time_us);
	if (error == 0)
		error = write_line(trail, object);
	if (error == 0)
		trail->number = number;
	return error;
}

int db_trail_sync(struct db_trail *trail)
{
	if (!trail->unsynced || trail->fd < 0)
		return 0;
	trail->unsynced = false;
	return fdatasync(trail->fd) == 0 ? 0 : -errno;
}

/* --- reading ---------------------------------------------------------------------------------- */

void db_trail_read_tail(struct db_trail *trail, size_t bytes, db_lines_fn *take, void *context)
{
	char *buffer = malloc(bytes);
	struct db_lines lines = { .chain = trail->chain };

	for (size_t i = trail->count > 1 ? trail->count - 2 : 0; buffer && i < trail->count; i++) {
		uint64_t size = trail->sizes[i];
		size_t part = size < bytes ? (size_t)size : bytes;
		int fd = open_segment(trail, trail->segments[i], O_RDONLY);
		ssize_t got = fd < 0 ? -1 : pread(fd, buffer, part, (off_t)(size - part));
		const char *from = buffer;

		if (fd >= 0)
			close(fd);
		if (got <= 0)
			continue;
		/* The first line is whole only at the begin of the file. */
		if (part < size)
			from = memchr(buffer, '\n', (size_t)got);
		if (!from)
			continue;
		from += part < size;
		lines.begun = lines.begun && part == size;
		(void)db_lines_read(&lines, from, (size_t)(buffer + got - from), take, context);
	}
	free(buffer);
}

void db_trail_find(struct db_trail *trail, uint64_t number, uint64_t since_us,
                   struct db_trail_place *place)
{
	json_int_t before = 0;
	char bytes[512];

	*place = (struct db_trail_place){ .segment = trail->count > 0 ? trail->segments[0] : 0,
		                          .lines.chain = trail->chain };
	for (size_t i = 0; i < trail->count; i++) {
		int fd = open_segment(trail, trail->segments[i], O_RDONLY);
		ssize_t got = fd < 0 ? -1 : pread(fd, bytes, sizeof(bytes), 0);
		const char *end = got > 0 ? memchr(bytes, '\n', (size_t)got) : NULL;
		json_t *head; /* of the segment; null: it cannot be read */
		json_int_t first;
		json_int_t time;
		bool later;
		if (fd >= 0)
			close(fd);
		head = end ? json_loadb(bytes, (size_t)(end - bytes), 0, NULL) : NULL;
		first = json_integer_value(json_object_get(head, "first"));
		time = json_integer_value(json_object_get(head, "time_us"));
		/* When the clock was set back, an earlier file has later times than this one. */
		later = !head || (since_us > 0 && time < before) ||
		        ((uint64_t)first > number && (uint64_t)time > since_us);

		json_decref(head);
		if (i > 0 && later)
			return;
		before = time;
		place->segment = trail->segments[i];
	}
}

bool db_trail_read(struct db_trail *trail, struct db_trail_place *place, size_t bytes,
                   db_lines_fn *take, void *context)
{
	size_t i = 0;
	size_t used = 0;
	char *buffer;
	ssize_t got;
	int fd;

	while (i < trail->count && trail->segments[i] < place->segment)
		i++;
	if (i == trail->count)
		return false;
	/* It was dropped while it was read: those that are left begin anew. */
	if (trail->segments[i] != place->segment) {
		place->segment = trail->segments[i];
		place->offset = 0;
		place->lines.begun = false;
		place->lines.number = 0;
	}
	buffer = malloc(bytes);
	fd = buffer ? open_segment(trail, place->segment, O_RDONLY) : -1;
	got = fd < 0 ? -1 : pread(fd, buffer, bytes, (off_t)place->offset);
	if (fd >= 0)
		close(fd);
	if (got > 0)
		used = db_lines_read(&place->lines, buffer, (size_t)got, take, context);
	free(buffer);
	place->offset += used;
	if (used > 0)
		return true;
	/* No whole line is left here. */
	if (i + 1 == trail->count)
		return false;
	place->segment = trail->segments[i + 1];
	place->offset = 0;
	return true;
}
