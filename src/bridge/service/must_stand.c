/* SPDX-License-Identifier: Apache-2.0 */
#include "service/service_private.h"

#include "drivebridge/command_table.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Time from a stop to the first check, and between checks. */
#define LOOK_AFTER_US 5000
#define LOOK_EVERY_US 100000

#define WORD_MAX 64
#define PLACE_MAX 256
#define LINE_MAX_LENGTH (PLACE_MAX + 2 * WORD_MAX)

/* No drive: the entry is of another run, or there is none at its place. */
#define NO_DRIVE UINT16_MAX

/* A drive that must stand, identified by its place, which does not depend on names in the
 * configuration. */
struct entry {
	char place[PLACE_MAX]; /* the bus's device or interface */
	unsigned address;
	unsigned axis;
	enum db_command command;
	uint16_t number; /* number of the drive in this run */
};

struct must_stand {
	char *path; /* null: it cannot be stored */
	char *written_to;
	bool failed; /* writing failed, which was logged */
	sd_event_source *timer;
	struct entry *entries;
	size_t count;
};

/* --- the file --------------------------------------------------------------------------------- */

static void log_failure(struct service *service, const char *what, int error)
{
	struct must_stand *known = service->must_stand;

	if (!known->failed)
		db_log(&service->log, service_now(service), DB_EVENT_FAILED, NULL,
		       "cannot %s %s: %s; a restart of the service forgets which drives must stand",
		       what, known->path ? known->path : "what must stand", strerror(error));
	known->failed = true;
}

/* Written under another name first: an existing file is always complete. */
static void write_file(struct service *service)
{
	struct must_stand *known = service->must_stand;
	bool good;
	FILE *file;

	if (!known->path)
		return;
	if (known->count == 0) {
		if (unlink(known->path) != 0 && errno != ENOENT)
			log_failure(service, "remove", errno);
		return;
	}
	file = fopen(known->written_to, "we");
	if (!file) {
		log_failure(service, "write", errno);
		return;
	}
	for (size_t i = 0; i < known->count; i++) {
		const struct entry *entry = &known->entries[i];

		fprintf(file, "%u %u %s %s\n", entry->address, entry->axis,
		        db_command_name(entry->command), entry->place);
	}
	good = !ferror(file);
	good = fclose(file) == 0 && good;
	if (!good || rename(known->written_to, known->path) != 0)
		log_failure(service, "write", errno);
	else
		known->failed = false;
}

static bool parse_line(char *line, struct entry *entry)
{
	static const enum db_command stops[] = { DB_CMD_STOP, DB_CMD_QUICK_STOP, DB_CMD_DISABLE };
	char command[WORD_MAX];
	int end = 0;

	*entry = (struct entry){ .command = DB_CMD_NONE, .number = NO_DRIVE };
	line[strcspn(line, "\n")] = '\0';
	if (sscanf(line, "%u %u %63s %n", &entry->address, &entry->axis, command, &end) != 3 ||
	    line[end] == '\0')
		return false;
	snprintf(entry->place, sizeof(entry->place), "%s", line + end);
	for (size_t i = 0; i < sizeof(stops) / sizeof(stops[0]); i++) {
		if (strcmp(command, db_command_name(stops[i])) == 0)
			entry->command = stops[i];
	}
	return entry->command != DB_CMD_NONE;
}

static int add_entry(struct entry **entries, size_t *count, const struct entry *entry)
{
	struct entry *more = realloc(*entries, (*count + 1) * sizeof(*more));

	if (!more)
		return -ENOMEM;
	more[(*count)++] = *entry;
	*entries = more;
	return 0;
}

/* --- the drives ------------------------------------------------------------------------------- */

static void look_in(struct service *service, uint64_t us)
{
	sd_event_source_set_time(service->must_stand->timer,
	                         (uint64_t)(service_now(service) / DB_NS_PER_US) + us);
	sd_event_source_set_enabled(service->must_stand->timer, SD_EVENT_ONESHOT);
}

static const char *place_of(const struct plant_drive *drive)
{
	const struct db_bus_config *bus = drive->bus->config;

	return bus->interface ? bus->interface : bus->device ? bus->device : "";
}

static bool is_at(const struct entry *entry, const struct plant_drive *drive)
{
	return strcmp(entry->place, place_of(drive)) == 0 &&
	       entry->address == drive->config->address && entry->axis == drive->config->axis;
}

static void describe(struct entry *entry, const struct plant_drive *drive, uint16_t command)
{
	*entry = (struct entry){
		.address = drive->config->address,
		.axis = drive->config->axis,
		.command = (enum db_command)command,
		.number = drive->number,
	};
	snprintf(entry->place, sizeof(entry->place), "%s", place_of(drive));
}

/* Until the bus has accepted it, the former entry holds why the drive must stand. The bus may not
 * have accepted pending requests yet, and a held motion has no holder in another run. */
static bool look_at_drive(struct service *service, const struct plant_drive *drive,
                          struct entry *entry)
{
	const struct must_stand *known = service->must_stand;
	const struct entry *former = NULL; /* of its place, of another run or before a reload */
	struct db_snapshot snapshot;
	const struct db_must_stand *must = &snapshot.must_stand;

	for (size_t i = 0; !former && i < known->count; i++) {
		if (is_at(&known->entries[i], drive) && known->entries[i].number != drive->number)
			former = &known->entries[i];
	}
	db_axis_read(drive->axis, &snapshot);
	if (former) {
		db_registers_stand(service->registers, drive->number, former->command,
		                   DB_STAND_RESTART, service_now(service));
		describe(entry, drive, (uint16_t)former->command);
		return true;
	}
	/* A drive that was seen standing once needs no stop of another run. */
	if (must->cause != DB_STAND_FREE && !must->seen) {
		describe(entry, drive, must->command);
		return true;
	}
	describe(entry, drive, (uint16_t)db_registers_owed_stop(service->registers, drive->number));
	return entry->command != DB_CMD_NONE;
}

void must_stand_look(struct service *service)
{
	struct must_stand *known = service->must_stand;
	const struct plant *plant = service->plant;
	struct entry *entries = NULL;
	size_t count = 0;
	size_t watched;
	struct entry entry;
	bool same;
	int error = 0;

	if (!known)
		return;
	for (size_t i = 0; i < plant->drive_count; i++) {
		if (look_at_drive(service, plant->drives[i], &entry))
			error |= add_entry(&entries, &count, &entry);
	}
	watched = count;
	/* A drive that was removed may be added again. */
	for (size_t i = 0; i < known->count; i++) {
		size_t place = 0;

		entry = known->entries[i];
		entry.number = NO_DRIVE;
		while (place < plant->drive_count && !is_at(&entry, plant->drives[place]))
			place++;
		if (place == plant->drive_count)
			error |= add_entry(&entries, &count, &entry);
	}
	if (error != 0)
		log_failure(service, "remember all of", ENOMEM);
	same = count == known->count;
	for (size_t i = 0; same && i < count; i++)
		same = entries[i].number == known->entries[i].number &&
		       entries[i].command == known->entries[i].command;
	free(known->entries);
	known->entries = entries;
	known->count = count;
	if (!same)
		write_file(service);
	/* `known` has the entries; gcc's analyzer takes them for lost. */
	if (watched > 0)
		look_in(service, LOOK_EVERY_US);
}

/* --- times ------------------------------------------------------------------------------------ */

static int on_due(sd_event_source *source, uint64_t us, void *context)
{
	struct service *service = context;

	(void)source;
	(void)us;
	must_stand_look(service);
	return 0;
}

void must_stand_look_soon(struct service *service)
{
	const struct must_stand *known = service->must_stand;
	int armed = SD_EVENT_OFF;
	uint64_t due = 0;

	if (!known || !known->timer)
		return;
	sd_event_source_get_enabled(known->timer, &armed);
	sd_event_source_get_time(known->timer, &due);
	/* The check of those that stand already may be later. */
	if (armed == SD_EVENT_OFF ||
	    due > (uint64_t)(service_now(service) / DB_NS_PER_US) + LOOK_AFTER_US)
		look_in(service, LOOK_AFTER_US);
}

int must_stand_begin(struct service *service)
{
	const char *socket = service->plant->edition->config->control.socket;
	struct must_stand *known = calloc(1, sizeof(*known));
	char line[LINE_MAX_LENGTH];
	struct entry entry;
	FILE *file = NULL;
	int error = 0;

	if (!known)
		return -ENOMEM;
	service->must_stand = known;
	if (strcmp(socket, DB_NO_SOCKET) != 0) {
		if (asprintf(&known->path, "%s.must-stand", socket) < 0)
			known->path = NULL;
		else if (asprintf(&known->written_to, "%s.new", known->path) < 0)
			known->written_to = NULL;
		error = known->path && known->written_to ? 0 : -ENOMEM;
	}
	if (error == 0 && known->path)
		file = fopen(known->path, "re");
	if (error == 0 && known->path && !file && errno != ENOENT)
		log_failure(service, "read", errno);
	while (error == 0 && file && fgets(line, sizeof(line), file)) {
		if (parse_line(line, &entry))
			error = add_entry(&known->entries, &known->count, &entry);
		else
			log_failure(service, "understand a line of", EINVAL);
	}
	if (file)
		fclose(file);
	if (error == 0)
		error = sd_event_add_time(service->loop, &known->timer, CLOCK_MONOTONIC, UINT64_MAX,
		                          0, on_due, service);
	if (error >= 0)
		error = sd_event_source_set_enabled(known->timer, SD_EVENT_OFF);
	if (error >= 0 && known->count > 0)
		must_stand_look(service);
	return error < 0 ? error : 0;
}

void must_stand_end(struct service *service)
{
	struct must_stand *known = service->must_stand;

	if (!known)
		return;
	if (known->timer && service->plant)
		must_stand_look(service);
	sd_event_source_disable_unref(known->timer);
	free(known->entries);
	free(known->path);
	free(known->written_to);
	free(known);
	service->must_stand = NULL;
}
