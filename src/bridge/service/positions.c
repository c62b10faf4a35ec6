/* SPDX-License-Identifier: Apache-2.0 */
#include "service/service_private.h"

#include "drivebridge/positions.h"
#include "service/configuration.h"
#include "service/disk.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FILE_NAME "positions.json"
/* Most bytes that are read: more than all positions have. */
#define TEXT_MAX ((size_t)4 * 1024 * 1024)
/* When the disk's thread has other work, or the disk fails. */
#define AGAIN_US 100000
#define AGAIN_AFTER_FAILURE_US 10000000

struct positions {
	struct db_positions list;
	char *path; /* null: they are kept in memory only */
	char *written_to;
	sd_event_source *timer; /* for the next try to write */
	bool changed;           /* since the text was made that was written last */
	char trouble[160];
};

/* A text on its way to the disk. */
struct writing {
	struct disk_job job; /* first: it is this */
	struct service *service;
	const char *path;
	const char *written_to;
	char *text;
	int error;
};

static void note_end(struct service *service, int error)
{
	struct positions *positions = service->positions;
	bool failed = positions->trouble[0] != '\0';

	positions->trouble[0] = '\0';
	if (error == 0)
		return;
	snprintf(positions->trouble, sizeof(positions->trouble), "cannot write %s: %s",
	         positions->path, strerror(error));
	if (!failed)
		db_log(&service->log, service_now(service), DB_EVENT_FAILED, NULL,
		       "%s; a restart of the service forgets the latest named positions",
		       positions->trouble);
}

/* --- writing ---------------------------------------------------------------------------------- */

static void write_in(struct service *service, uint64_t us)
{
	(void)sd_event_source_set_time_relative(service->positions->timer, us);
	(void)sd_event_source_set_enabled(service->positions->timer, SD_EVENT_ONESHOT);
}

static void work(struct disk_job *job)
{
	struct writing *writing = (struct writing *)job;

	writing->error = disk_replace_file(writing->path, writing->written_to, writing->text);
}

static void free_writing(struct writing *writing)
{
	if (!writing)
		return;
	free(writing->text);
	free(writing);
}

static void done(struct disk_job *job)
{
	struct writing *writing = (struct writing *)job;
	struct service *service = writing->service;

	service->writing = NULL;
	note_end(service, writing->error);
	if (writing->error != 0)
		service->positions->changed = true;
	if (service->positions->changed)
		write_in(service, writing->error != 0 ? AGAIN_AFTER_FAILURE_US : 0);
	free_writing(writing);
}

/* Hands what there is now to the disk's thread; later if that has other work. */
static int on_timer(sd_event_source *source, uint64_t us, void *context)
{
	struct service *service = context;
	struct positions *positions = service->positions;
	struct writing *writing;

	(void)source;
	(void)us;
	if (service->writing || !positions->changed)
		return 0;
	writing = calloc(1, sizeof(*writing));
	if (writing) {
		*writing = (struct writing){ .job = { .work = work, .done = done },
			                     .service = service,
			                     .path = positions->path,
			                     .written_to = positions->written_to,
			                     .text = db_positions_write(&positions->list) };
		if (writing->text && configuration_work(service, &writing->job)) {
			service->writing = writing;
			positions->changed = false;
			return 0;
		}
		free_writing(writing);
	}
	write_in(service, AGAIN_US);
	return 0;
}

void positions_changed(void *context)
{
	struct service *service = context;
	struct positions *positions = service->positions;

	positions->changed = positions->path != NULL;
	if (positions->changed && !service->writing)
		write_in(service, 0);
}

/* --- beginning and end ------------------------------------------------------------------------ */

/* A whole file, to be freed. Null with errno; ENOENT: there is none. */
static char *read_text(const char *path)
{
	FILE *file = fopen(path, "re");
	char *text = file ? calloc(1, TEXT_MAX + 1) : NULL;
	size_t length = text ? fread(text, 1, TEXT_MAX, file) : 0;
	int error = 0;

	if (!file)
		return NULL;
	if (!text)
		error = ENOMEM;
	else if (ferror(file))
		error = EIO;
	else if (length == TEXT_MAX || strlen(text) != length)
		error = EINVAL;
	(void)fclose(file);
	if (error == 0)
		return text;
	free(text);
	errno = error;
	return NULL;
}

/* A file that cannot be understood is kept under another name. */
static int load(struct service *service)
{
	struct positions *positions = service->positions;
	char *text = read_text(positions->path);
	int error = text ? -db_positions_read(&positions->list, text) : errno;
	char *aside = NULL;

	free(text);
	if (error == 0 || error == ENOENT)
		return 0;
	if (error == ENOMEM)
		return -error;
	if (asprintf(&aside, "%s.damaged", positions->path) < 0)
		return -ENOMEM;
	db_log(&service->log, service_now(service), DB_EVENT_FAILED, NULL,
	       "cannot read the named positions in %s: %s; %s %s, and there are none now",
	       positions->path, strerror(error),
	       rename(positions->path, aside) == 0 ? "it is kept as" : "it could not be renamed to",
	       aside);
	free(aside);
	return 0;
}

int positions_begin(struct service *service)
{
	struct positions *positions = calloc(1, sizeof(*positions));
	int error;

	if (!positions)
		return -ENOMEM;
	service->positions = positions;
	error = service_state_path(FILE_NAME, &positions->path);
	if (error == 0 && positions->path &&
	    asprintf(&positions->written_to, "%s.new", positions->path) < 0) {
		positions->written_to = NULL;
		error = -ENOMEM;
	}
	if (error == 0 && positions->path)
		error = load(service);
	if (error == 0)
		error = sd_event_add_time(service->loop, &positions->timer, CLOCK_MONOTONIC,
		                          UINT64_MAX, 0, on_timer, service);
	if (error >= 0)
		error = sd_event_source_set_enabled(positions->timer, SD_EVENT_OFF);
	return error < 0 ? error : 0;
}

struct db_positions *positions_list(void *context)
{
	struct service *service = context;

	return service->positions ? &service->positions->list : NULL;
}

const char *positions_trouble(void *context)
{
	const struct service *service = context;

	return service->positions ? service->positions->trouble : "";
}

void positions_end(struct service *service)
{
	struct positions *positions = service->positions;

	if (!positions)
		return;
	/* The disk's thread may have ended before it came to this. */
	if (positions->path && (positions->changed || service->writing)) {
		char *text = db_positions_write(&positions->list);

		note_end(service,
		         text ? disk_replace_file(positions->path, positions->written_to, text) :
		                ENOMEM);
		free(text);
	}
	free_writing(service->writing);
	service->writing = NULL;
	sd_event_source_disable_unref(positions->timer);
	db_positions_clear(&positions->list);
	free(positions->path);
	free(positions->written_to);
	free(positions);
	service->positions = NULL;
}
