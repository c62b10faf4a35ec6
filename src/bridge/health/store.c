/* SPDX-License-Identifier: Apache-2.0 */
#include "health/health_private.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#define FILE_NAME "values"
#define NEW_SUFFIX ".new"
/* After so long without the service an hour is not continued. */
#define CONTINUE_US (UINT64_C(3600) * 1000000)
#define US_PER_S 1000000
/* What a client can take as a whole number. */
#define TIME_MAX_US (UINT64_C(1) << 53)

struct db_store {
	char *folder; /* null: there is none */
	int fd;       /* of the file, or of memory */
	bool in_file;
	bool begun; /* an interval was added in this run */
	uint32_t run;
	uint32_t next; /* number of the next interval */
	struct db_ring_shape shape;
	struct db_ring_column columns[DB_RING_COLUMNS_MAX];
	uint8_t slot[DB_RING_SLOT_MAX]; /* the one that was read last, or is to be written */
};

/* --- reading and writing ---------------------------------------------------------------------- */

static int write_at(int fd, const uint8_t *bytes, size_t size, size_t place)
{
	while (size > 0) {
		ssize_t written = pwrite(fd, bytes, size, (off_t)place);

		if (written < 0 && errno == EINTR)
			continue;
		if (written <= 0)
			return written < 0 ? -errno : -EIO;
		bytes += written;
		place += (size_t)written;
		size -= (size_t)written;
	}
	return 0;
}

static bool read_at(int fd, uint8_t *bytes, size_t size, size_t place)
{
	while (size > 0) {
		ssize_t got = pread(fd, bytes, size, (off_t)place);

		if (got < 0 && errno == EINTR)
			continue;
		if (got <= 0)
			return false;
		bytes += got;
		place += (size_t)got;
		size -= (size_t)got;
	}
	return true;
}

/* The slot of this number, into store->slot. False: it is not there (any more), or damaged. */
static bool load(struct db_store *store, enum db_ring ring, uint32_t number,
                 struct db_ring_slot *slot)
{
	return read_at(store->fd, store->slot, db_ring_slot_bytes(&store->shape),
	               db_ring_place(&store->shape, ring, number)) &&
	       db_ring_read_slot(&store->shape, ring, store->slot, slot) && slot->number == number;
}

/* store->slot into its place. */
static int save(struct db_store *store, enum db_ring ring, const struct db_ring_slot *slot)
{
	db_ring_write_slot(&store->shape, ring, slot, store->slot);
	return write_at(store->fd, store->slot, db_ring_slot_bytes(&store->shape),
	                db_ring_place(&store->shape, ring, slot->number));
}

/* --- another file, or memory ------------------------------------------------------------------ */

static int open_in(const char *folder, const char *name, const char *suffix, int flags)
{
	char path[PATH_MAX];
	int length = snprintf(path, sizeof(path), "%s/%s%s", folder, name, suffix);

	if (length >= (int)sizeof(path))
		return -ENAMETOOLONG;
	length = open(path, flags | O_CLOEXEC | O_NOFOLLOW, S_IRUSR | S_IWUSR | S_IRGRP);
	return length < 0 ? -errno : length;
}

/* A new file gets its name when it is on the disk, and the name outlives a loss of power, too. */
static int rename_new(const char *folder, const char *name, int fd)
{
	int in = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
	char other[NAME_MAX];
	int error = 0;

	if (in < 0)
		return -errno;
	snprintf(other, sizeof(other), "%s" NEW_SUFFIX, name);
	if (fsync(fd) != 0 || renameat(in, other, in, name) != 0 || fsync(in) != 0)
		error = -errno;
	close(in);
	return error;
}

static int open_new(const char *folder, const char *name)
{
	const char *slash = strrchr(folder, '/');
	char parent[PATH_MAX];
	int error = 0;
	int in;

	/* A new folder outlives a loss of power, too. */
	if (mkdir(folder, S_IRWXU | S_IRGRP | S_IXGRP) == 0) {
		snprintf(parent, sizeof(parent), "%.*s", slash ? (int)(slash - folder + 1) : 1,
		         slash ? folder : ".");
		in = open(parent, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
		if (in < 0 || fsync(in) != 0)
			error = -errno;
		if (in >= 0)
			close(in);
	} else if (errno != EEXIST) {
		error = -errno;
	}
	if (error != 0)
		return error;
	return open_in(folder, name, NEW_SUFFIX, O_RDWR | O_CREAT | O_TRUNC);
}

int db_store_replace(const char *folder, const char *name, const void *bytes, size_t size)
{
	int fd = open_new(folder, name);
	int error = fd < 0 ? fd : write_at(fd, bytes, size, 0);

	if (error == 0)
		error = rename_new(folder, name, fd);
	if (fd >= 0)
		close(fd);
	return error;
}

/* Room for all slots, so that later writes need none. A negative errno, or the descriptor. */
static int make_room(const char *folder, size_t size)
{
	int fd = folder ? open_new(folder, FILE_NAME) :
	                  memfd_create("drivebridge-health", MFD_CLOEXEC);
	int error;

	if (fd < 0)
		return folder ? fd : -errno;
	/* Memory is taken when it is written. */
	if (folder)
		error = posix_fallocate(fd, 0, (off_t)size);
	else
		error = ftruncate(fd, (off_t)size) != 0 ? errno : 0;
	if (error == 0)
		return fd;
	close(fd);
	return -error;
}

/* The slots that fit into `to`, which may have more columns. */
static int copy_slots(struct db_store *store, const struct db_ring_shape *to, int fd)
{
	uint8_t bytes[DB_RING_SLOT_MAX];

	for (unsigned ring = 0; ring < DB_RING_COUNT; ring++) {
		uint32_t end = store->next / db_ring_widths[ring] + 1;
		uint32_t most = to->slots[ring];

		for (uint32_t number = end > most ? end - most : 0; number < end; number++) {
			struct db_ring_slot slot;
			int error;

			if (!load(store, ring, number, &slot))
				continue;
			db_ring_clear_slot(to, bytes);
			memcpy(db_ring_value_of(bytes, 0), db_ring_value_of(store->slot, 0),
			       (size_t)store->shape.columns * DB_HEALTH_VALUE_BYTES);
			db_ring_write_slot(to, ring, &slot, bytes);
			error = write_at(fd, bytes, db_ring_slot_bytes(to),
			                 db_ring_place(to, ring, number));
			if (error != 0)
				return error;
		}
	}
	return 0;
}

/* Moves everything: into a file of the folder, or with null into memory; with these columns. 0 or a
 * negative errno: then nothing has changed. */
static int move(struct db_store *store, const char *folder, const struct db_ring_shape *shape,
                const struct db_ring_column *columns)
{
	uint8_t head[DB_RING_HEAD_MAX];
	int fd = make_room(folder, db_ring_file_bytes(shape));
	int error;

	if (fd < 0)
		return fd;
	db_ring_write_head(shape, columns, head);
	error = write_at(fd, head, db_ring_head_bytes(shape), 0);
	if (error == 0)
		error = copy_slots(store, shape, fd);
	if (error == 0 && folder)
		error = rename_new(folder, FILE_NAME, fd);
	if (error != 0) {
		close(fd);
		return error;
	}
	close(store->fd);
	store->fd = fd;
	store->in_file = folder != NULL;
	store->shape = *shape;
	if (columns != store->columns)
		memcpy(store->columns, columns, shape->columns * sizeof(*columns));
	return 0;
}

/* --- beginning and end ------------------------------------------------------------------------ */

/* False: there is none. One that cannot be used is kept under another name. */
static bool open_file(struct db_store *store, bool *damaged)
{
	uint8_t head[DB_RING_HEAD_MAX];
	struct stat status;
	int fd = open_in(store->folder, FILE_NAME, "", O_RDWR);
	ssize_t got;
	uint32_t newest_run;
	int there;

	if (fd < 0)
		return false;
	got = pread(fd, head, sizeof(head), 0);
	if (got < 0 || !db_ring_read_head(head, (size_t)got, &store->shape, store->columns) ||
	    fstat(fd, &status) != 0 || status.st_size < (off_t)db_ring_file_bytes(&store->shape)) {
		close(fd);
		there = open(store->folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
		if (there >= 0) {
			(void)renameat(there, FILE_NAME, there, FILE_NAME DB_HEALTH_DAMAGED);
			close(there);
		}
		*damaged = true;
		return false;
	}
	store->fd = fd;
	store->in_file = true;
	/* The numbers go on where those in the file end. */
	newest_run = 0;
	for (unsigned ring = 0; ring < DB_RING_COUNT; ring++) {
		uint32_t width = db_ring_widths[ring];

		for (uint32_t place = 0; place < store->shape.slots[ring]; place++) {
			struct db_ring_slot slot;

			if (!read_at(store->fd, store->slot, db_ring_slot_bytes(&store->shape),
			             db_ring_place(&store->shape, ring, place)) ||
			    !db_ring_read_slot(&store->shape, ring, store->slot, &slot) ||
			    slot.number % store->shape.slots[ring] != place ||
			    slot.number >= UINT32_MAX / 2 / width)
				continue;
			if (slot.run > newest_run)
				newest_run = slot.run;
			/* A quarter that was ended early has its first minutes only. */
			if (ring == DB_RING_MINUTES && slot.number >= store->next)
				store->next = slot.number + 1;
			if (ring != DB_RING_MINUTES && slot.number * width >= store->next)
				store->next = (slot.number + 1) * width;
		}
	}
	store->run = newest_run + 1;
	return true;
}

int db_store_open(const char *folder, struct db_store **store, bool *damaged)
{
	struct db_store *made = calloc(1, sizeof(*made));

	if (!made)
		return -ENOMEM;
	*damaged = false;
	made->fd = -1;
	made->folder = folder ? strdup(folder) : NULL;
	if (folder && !made->folder) {
		free(made);
		return -ENOMEM;
	}
	if (!made->folder || !open_file(made, damaged)) {
		memset(made->columns, 0, sizeof(made->columns));
		made->run = 1;
		db_ring_shape_for(1, &made->shape);
		made->fd = make_room(NULL, db_ring_file_bytes(&made->shape));
		if (made->fd < 0) {
			int error = made->fd;

			free(made->folder);
			free(made);
			return error;
		}
	}
	*store = made;
	return 0;
}

void db_store_free(struct db_store *store)
{
	if (!store)
		return;
	close(store->fd);
	free(store->folder);
	free(store);
}

/* --- columns ---------------------------------------------------------------------------------- */

static bool is_drive(const struct db_ring_column *column, const struct db_store_entry *entry)
{
	return column->unit == entry->unit && strcmp(column->name, entry->name) == 0;
}

/* SIZE_MAX: it has none. */
static size_t column_of(const struct db_ring_column *columns, size_t count,
                        const struct db_store_entry *entry)
{
	for (size_t i = 0; i < count; i++) {
		if (is_drive(&columns[i], entry))
			return i;
	}
	return SIZE_MAX;
}

/* A free column; else the one that was given away first of those whose drive is not there any more;
 * SIZE_MAX. */
static size_t place_for(const struct db_ring_column *columns, size_t count,
                        const struct db_store_interval *interval)
{
	size_t oldest = SIZE_MAX;

	for (size_t i = 0; i < count; i++) {
		size_t k = 0;

		if (columns[i].name[0] == '\0')
			return i;
		while (k < interval->count && !is_drive(&columns[i], &interval->entries[k]))
			k++;
		if (k == interval->count &&
		    (oldest == SIZE_MAX || columns[i].since < columns[oldest].since))
			oldest = i;
	}
	return oldest;
}

/* Every drive of the interval gets a column. True: something has changed. */
static bool assign_columns(const struct db_store *store, const struct db_store_interval *interval,
                           struct db_ring_shape *shape, struct db_ring_column *columns)
{
	bool changed = false;

	*shape = store->shape;
	if (interval->count > shape->columns)
		db_ring_shape_for(interval->count, shape);
	for (size_t i = 0; i < interval->count; i++) {
		const struct db_store_entry *entry = &interval->entries[i];
		size_t place;

		if (column_of(columns, shape->columns, entry) != SIZE_MAX)
			continue;
		/* There are as many columns as drives, so one of them is found. */
		place = place_for(columns, shape->columns, interval);
		columns[place] = (struct db_ring_column){ .unit = entry->unit,
			                                  .since = store->next };
		memcpy(columns[place].name, entry->name, sizeof(entry->name));
		changed = true;
	}
	return changed;
}

/* --- adding ----------------------------------------------------------------------------------- */

/* The values of the minutes from `first` to `end`, in sums[]; their last slot in *slot. False:
 * there are none. */
static bool add_up(struct db_store *store, uint32_t first, uint32_t end,
                   struct db_health_value *sums, struct db_ring_slot *slot)
{
	struct db_ring_slot minute;
	uint32_t span = 0;
	bool any = false;

	for (size_t i = 0; i < store->shape.columns; i++)
		sums[i] = (struct db_health_value){ .coldest = DB_HEALTH_NO_TEMPERATURE,
			                            .hottest = DB_HEALTH_NO_TEMPERATURE };
	for (uint32_t number = first; number < end; number++) {
		if (!load(store, DB_RING_MINUTES, number, &minute))
			continue;
		any = true;
		span += minute.span_s;
		*slot = minute;
		for (size_t i = 0; i < store->shape.columns; i++) {
			struct db_health_value value;

			db_health_value_read(db_ring_value_of(store->slot, i), &value);
			if (number >= store->columns[i].since)
				db_health_value_add(&sums[i], &value);
		}
	}
	if (any)
		slot->span_s = span > UINT16_MAX ? UINT16_MAX : (uint16_t)span;
	return any;
}

/* Writes the quarter or hour of this number from its minutes, as far as there are any. */
static int derive(struct db_store *store, enum db_ring ring, uint32_t number)
{
	uint32_t first = number * db_ring_widths[ring];
	struct db_health_value *sums = calloc(store->shape.columns, sizeof(*sums));
	struct db_ring_slot slot;
	int error = 0;

	if (!sums)
		return -ENOMEM;
	if (add_up(store, first, first + db_ring_widths[ring], sums, &slot)) {
		slot.number = number;
		for (size_t i = 0; i < store->shape.columns; i++)
			db_health_value_write(&sums[i], db_ring_value_of(store->slot, i));
		error = save(store, ring, &slot);
	}
	free(sums);
	return error;
}

/* What an earlier run had no time for: the quarter and the hour that end with its last minute.
 * After a longer time without the service the next hour begins, too. */
static int finish_earlier(struct db_store *store, uint64_t wall_us)
{
	struct db_ring_slot last;
	bool later;
	int error = 0;

	if (store->next == 0 || !load(store, DB_RING_MINUTES, store->next - 1, &last))
		return 0;
	later = wall_us > last.wall_us && wall_us - last.wall_us > CONTINUE_US;
	for (enum db_ring ring = DB_RING_QUARTERS; error == 0 && ring < DB_RING_COUNT; ring++) {
		uint32_t width = db_ring_widths[ring];

		if (later || store->next % width == 0)
			error = derive(store, ring, (store->next - 1) / width);
	}
	if (error == 0 && later) {
		uint32_t hour = db_ring_widths[DB_RING_HOURS];

		store->next = (store->next + hour - 1) / hour * hour;
	}
	return error;
}

static int write_interval(struct db_store *store, const struct db_store_interval *interval)
{
	const struct db_ring_slot slot = {
		.number = store->next,
		.run = store->run,
		.clock_s = interval->clock_s,
		.span_s = interval->span_s,
		.wall_us = interval->wall_us,
	};
	int error;

	db_ring_clear_slot(&store->shape, store->slot);
	for (size_t i = 0; i < interval->count; i++) {
		size_t column = column_of(store->columns, store->shape.columns,
		                          &interval->entries[i]);

		if (column != SIZE_MAX)
			memcpy(db_ring_value_of(store->slot, column), interval->entries[i].value,
			       DB_HEALTH_VALUE_BYTES);
	}
	error = save(store, DB_RING_MINUTES, &slot);
	for (enum db_ring ring = DB_RING_QUARTERS; error == 0 && ring < DB_RING_COUNT; ring++) {
		if ((store->next + 1) % db_ring_widths[ring] == 0)
			error = derive(store, ring, store->next / db_ring_widths[ring]);
	}
	if (error == 0 && store->in_file && fdatasync(store->fd) != 0)
		error = -errno;
	return error;
}

int db_store_add(struct db_store *store, const struct db_store_interval *interval)
{
	struct db_ring_column columns[DB_RING_COLUMNS_MAX];
	struct db_ring_shape shape;
	bool changed;
	int failure = 0;
	int error = 0;

	if (!store->begun)
		failure = finish_earlier(store, interval->wall_us);
	store->begun = true;
	memcpy(columns, store->columns, sizeof(columns));
	changed = assign_columns(store, interval, &shape, columns);
	if (store->folder && (changed || !store->in_file)) {
		error = move(store, store->folder, &shape, columns);
		failure = error != 0 ? error : failure;
	}
	if (changed && (!store->folder || error != 0))
		error = move(store, NULL, &shape, columns);
	else
		error = 0;
	if (error == 0)
		error = write_interval(store, interval);
	if (error != 0 && store->in_file) {
		failure = error;
		error = move(store, NULL, &store->shape, store->columns);
		if (error == 0)
			error = write_interval(store, interval);
	}
	/* Without memory, too, the interval is lost, and its number with it. */
	store->next++;
	return error != 0 ? error : failure;
}

/* --- reading ---------------------------------------------------------------------------------- */

/* What makes a time of a clock's seconds. The last slot of a run has the best one: a clock that was
 * set in that run corrects all times of it. */
struct correction {
	uint32_t run;
	uint64_t add_us;
};

/* Clocks are noted in seconds: a time that differs by less is right, and stays the same. */
#define SLACK_US (2 * US_PER_S)

static uint64_t correct(struct correction *correction, const struct db_ring_slot *slot)
{
	uint64_t clock_us = (uint64_t)slot->clock_s * US_PER_S;
	uint64_t time;

	if (slot->run != correction->run)
		*correction = (struct correction){ .run = slot->run,
			                           .add_us = slot->wall_us - clock_us };
	time = clock_us + correction->add_us;
	if (time - slot->wall_us + SLACK_US < 2 * (uint64_t)SLACK_US)
		time = slot->wall_us;
	return time > TIME_MAX_US ? 0 : time;
}

/* The finest ring that has what was wanted, or everything. */
static enum db_ring choose_ring(struct db_store *store, const struct db_health_query *query)
{
	enum db_ring ring = DB_RING_MINUTES;

	for (; ring < DB_RING_HOURS; ring++) {
		uint32_t end = store->next / db_ring_widths[ring];
		uint32_t slots = store->shape.slots[ring];
		struct db_ring_slot oldest;

		if (query->step_s != 0) {
			if (query->step_s == db_ring_widths[ring] * DB_HEALTH_INTERVAL_S)
				return ring;
			continue;
		}
		if (end <= slots ||
		    (query->since_us != 0 && load(store, ring, end - slots, &oldest) &&
		     oldest.wall_us <= query->since_us))
			return ring;
	}
	return ring;
}

/* The column of the drive of this name that came last; SIZE_MAX. */
static size_t column_named(const struct db_store *store, const char *name)
{
	size_t found = SIZE_MAX;

	for (size_t i = 0; i < store->shape.columns; i++) {
		if (strcmp(store->columns[i].name, name) == 0 &&
		    (found == SIZE_MAX || store->columns[i].since > store->columns[found].since))
			found = i;
	}
	return found;
}

/* What a reader gets, while the slots are read from the newest to the oldest. */
struct reading {
	struct db_store *store;
	const struct db_health_query *query;
	size_t column; /* SIZE_MAX: all of them */
	struct correction correction;
	struct db_health_value *sums; /* of each column */
	uint64_t newest_us;
	uint64_t span_s;
	/* Of the column: */
	struct row {
		uint64_t end_us;
		uint16_t span_s;
		struct db_health_value value;
	} * rows;
	size_t count;
	/* With query->rows: of each slot, counted by `count`, one of each column. */
	struct cell {
		bool known;
		uint32_t lost_ppm;
		uint32_t offline_ms;
	} * cells;
};

/* A slot, with values[] of each column. */
static void take_slot(struct reading *reading, enum db_ring ring, const struct db_ring_slot *slot,
                      const struct db_health_value *values)
{
	uint64_t end_us = correct(&reading->correction, slot);
	const struct db_store *store = reading->store;

	if (end_us <= reading->query->since_us && reading->query->since_us != 0)
		return;
	if (reading->newest_us == 0)
		reading->newest_us = end_us;
	reading->span_s += slot->span_s;
	for (size_t i = 0; i < store->shape.columns; i++) {
		/* A column that had another drive before. */
		if ((uint64_t)(slot->number + 1) * db_ring_widths[ring] <= store->columns[i].since)
			continue;
		if (reading->cells) {
			struct cell *cell =
				&reading->cells[reading->count * store->shape.columns + i];

			*cell = (struct cell){ .known = values[i].known,
				               .offline_ms = values[i].offline_ms };
			if (values[i].exchanges > 0)
				cell->lost_ppm = (uint32_t)((uint64_t)values[i].losses * 1000000 /
				                            values[i].exchanges);
		} else if (reading->column == SIZE_MAX)
			db_health_value_add(&reading->sums[i], &values[i]);
		else if (reading->column == i && values[i].known)
			reading->rows[reading->count++] = (struct row){ .end_us = end_us,
				                                        .span_s = slot->span_s,
				                                        .value = values[i] };
	}
	if (reading->cells)
		reading->rows[reading->count++] = (struct row){ .end_us = end_us,
			                                        .span_s = slot->span_s };
}

static void read_slots(struct reading *reading, enum db_ring ring, struct db_health_value *values)
{
	struct db_store *store = reading->store;
	uint32_t width = db_ring_widths[ring];
	uint32_t end = store->next / width;
	uint32_t slots = store->shape.slots[ring];
	struct db_ring_slot slot;

	/* The last one is not over yet. */
	if (store->next % width != 0 && add_up(store, end * width, store->next, values, &slot)) {
		slot.number = end;
		take_slot(reading, ring, &slot, values);
	}
	for (uint32_t number = end; number-- > (end > slots ? end - slots : 0);) {
		if (!load(store, ring, number, &slot))
			continue;
		for (size_t i = 0; i < store->shape.columns; i++)
			db_health_value_read(db_ring_value_of(store->slot, i), &values[i]);
		take_slot(reading, ring, &slot, values);
	}
}

static void print_values(const struct reading *reading, FILE *out)
{
	const struct db_store *store = reading->store;
	size_t printed = 0;

	for (size_t i = reading->count; i-- > 0;) {
		const struct row *row = &reading->rows[i];

		if (printed++ > 0)
			fputc(',', out);
		db_health_value_print(&row->value, reading->query->drive, row->end_us, row->span_s,
		                      out);
	}
	for (size_t i = 0; reading->column == SIZE_MAX && i < store->shape.columns; i++) {
		if (!reading->sums[i].known)
			continue;
		if (printed++ > 0)
			fputc(',', out);
		db_health_value_print(&reading->sums[i], store->columns[i].name, reading->newest_us,
		                      reading->span_s, out);
	}
}

/* A figure of each slot, oldest first; null where the drive was not known. */
static void print_figures(const struct reading *reading, size_t column, bool offline, FILE *out)
{
	for (size_t i = reading->count; i-- > 0;) {
		const struct cell *cell =
			&reading->cells[i * reading->store->shape.columns + column];

		if (cell->known)
			fprintf(out, "%" PRIu32, offline ? cell->offline_ms : cell->lost_ppm);
		else
			fputs("null", out);
		if (i > 0)
			fputc(',', out);
	}
}

static void print_rows(const struct reading *reading, FILE *out)
{
	const struct db_store *store = reading->store;
	size_t printed = 0;

	fputs("\"times\":[", out);
	for (size_t i = reading->count; i-- > 0;)
		fprintf(out, "{\"end_us\":%" PRIu64 ",\"span_s\":%u}%s", reading->rows[i].end_us,
		        reading->rows[i].span_s, i > 0 ? "," : "");
	fputs("],\"rows\":[", out);
	for (size_t column = 0; column < store->shape.columns; column++) {
		if (store->columns[column].name[0] == '\0' ||
		    column_named(store, store->columns[column].name) != column)
			continue;
		fprintf(out, "%s{\"drive\":\"%s\",\"lost_ppm\":[", printed++ > 0 ? "," : "",
		        store->columns[column].name);
		print_figures(reading, column, false, out);
		fputs("],\"offline_ms\":[", out);
		print_figures(reading, column, true, out);
		fputs("]}", out);
	}
	fputc(']', out);
}

void db_store_read(struct db_store *store, const struct db_health_query *query, uint32_t clock_s,
                   uint64_t wall_us, struct db_health_page *page)
{
	enum db_ring ring = choose_ring(store, query);
	struct reading reading = {
		.store = store,
		.query = query,
		.column = query->drive[0] ? column_named(store, query->drive) : SIZE_MAX,
		.correction = { .run = store->run,
		                .add_us = wall_us - (uint64_t)clock_s * US_PER_S },
	};
	struct db_health_value *values;
	FILE *out;

	*page = (struct db_health_page){ .step_s = db_ring_widths[ring] * DB_HEALTH_INTERVAL_S };
	page->known = query->drive[0] == '\0' || reading.column != SIZE_MAX;
	if (!page->known)
		return;
	values = calloc(store->shape.columns, sizeof(*values));
	reading.sums = calloc(store->shape.columns, sizeof(*reading.sums));
	reading.rows = calloc((size_t)store->shape.slots[ring] + 1, sizeof(*reading.rows));
	if (query->rows)
		reading.cells = calloc((size_t)(store->shape.slots[ring] + 1) *
		                               store->shape.columns,
		                       sizeof(*reading.cells));
	out = open_memstream(&page->values, &page->length);
	if (values && reading.sums && reading.rows && (reading.cells || !query->rows) && out) {
		read_slots(&reading, ring, values);
		if (query->rows)
			print_rows(&reading, out);
		else
			print_values(&reading, out);
	}
	if (out)
		fclose(out);
	free(reading.cells);
	free(reading.rows);
	free(reading.sums);
	free(values);
}
