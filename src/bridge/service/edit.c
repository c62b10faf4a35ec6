/* SPDX-License-Identifier: Apache-2.0 */
#include "service/edit.h"

#include "drivebridge/config.h"
#include "service/configuration.h"
#include "service/disk.h"
#include "service/service_private.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define FORMER "former-"
#define FORMER_SUFFIX ".conf"

struct edit {
	struct disk_job job; /* the first member: the disk's thread and its news know only this */
	struct service *service;
	enum db_edit_kind kind;
	bool writes; /* the second half of a SET */
	uint32_t former;
	uint64_t given; /* the version that the client has */
	char *text;
	char *before; /* text of the file that is replaced */
	char *path;
	char *folder; /* of `path`, with the slash */

	/* The results of the disk's thread. */
	enum db_edit_end end;
	int error;
	uint64_t version;
	struct db_config *config;
	char *messages;
	uint32_t numbers[DB_EDIT_FORMERS + 1]; /* of former texts, the newest first */
	uint64_t times_us[DB_EDIT_FORMERS + 1];
	size_t former_count;
};

/* --- on the disk's thread --------------------------------------------------------------------- */

static void fail(struct edit *edit, int error)
{
	edit->end = DB_EDIT_FAILED;
	edit->error = error;
}

/* The number of a former text by its file's name; 0: it is none. */
static uint32_t number_of(const char *name)
{
	char *end;
	unsigned long number;

	if (strncmp(name, FORMER, strlen(FORMER)) != 0 || name[strlen(FORMER)] < '1' ||
	    name[strlen(FORMER)] > '9')
		return 0;
	number = strtoul(name + strlen(FORMER), &end, 10);
	return strcmp(end, FORMER_SUFFIX) == 0 && number < UINT32_MAX ? (uint32_t)number : 0;
}

/* Its path, to be freed; null: no memory. */
static char *former_path(const struct edit *edit, uint32_t number)
{
	char *path;

	return asprintf(&path, "%s" FORMER "%u" FORMER_SUFFIX, edit->folder, (unsigned)number) < 0 ?
	               NULL :
	               path;
}

/* Puts one into the list of the newest ones; returns the number that has no place, or 0. */
static uint32_t list_former(struct edit *edit, uint32_t number)
{
	size_t place = edit->former_count;

	while (place > 0 && edit->numbers[place - 1] < number)
		place--;
	memmove(&edit->numbers[place + 1], &edit->numbers[place],
	        (edit->former_count - place) * sizeof(edit->numbers[0]));
	edit->numbers[place] = number;
	if (edit->former_count < DB_EDIT_FORMERS) {
		edit->former_count++;
		return 0;
	}
	return edit->numbers[DB_EDIT_FORMERS];
}

/* Lists the newest former texts; with `removes`, older ones are removed. */
static void list_formers(struct edit *edit, bool removes)
{
	DIR *folder = opendir(edit->folder);
	const struct dirent *entry;

	edit->former_count = 0;
	while (folder && (entry = readdir(folder))) {
		uint32_t number = number_of(entry->d_name);
		uint32_t left = number != 0 ? list_former(edit, number) : 0;

		if (removes && left != 0) {
			char *path = former_path(edit, left);

			/* One that cannot be removed takes room, and nothing else. */
			if (path)
				(void)unlink(path);
			free(path);
		}
	}
	if (folder)
		closedir(folder);
	for (size_t i = 0; i < edit->former_count; i++) {
		char *path = former_path(edit, edit->numbers[i]);
		struct stat about;

		edit->times_us[i] = 0;
		if (path && stat(path, &about) == 0)
			edit->times_us[i] = (uint64_t)about.st_mtim.tv_sec * 1000000 +
			                    (uint64_t)about.st_mtim.tv_nsec / 1000;
		free(path);
	}
}

/* A text of at most DB_EDIT_TEXT_MAX bytes; "" where there is no file and that is `optional`. To be
 * freed; null with errno. */
static char *read_text(const char *path, bool optional)
{
	int fd = open(path, O_RDONLY | O_NOCTTY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
	char *text = fd >= 0 || (optional && errno == ENOENT) ? calloc(1, DB_EDIT_TEXT_MAX + 2) :
	                                                        NULL;
	size_t used = 0;
	ssize_t got = 1;
	int error = text ? 0 : errno;

	while (text && fd >= 0 && got > 0 && used <= DB_EDIT_TEXT_MAX) {
		got = read(fd, text + used, DB_EDIT_TEXT_MAX + 1 - used);
		used += got > 0 ? (size_t)got : 0;
	}
	if (got < 0)
		error = errno;
	else if (used > DB_EDIT_TEXT_MAX)
		error = EFBIG;
	if (fd >= 0)
		close(fd);
	if (error != 0) {
		free(text);
		text = NULL;
		errno = error;
	}
	return text;
}

static void write_text(struct edit *edit)
{
	char *written_to;
	char *kept;
	int error;
	int fd;

	/* The package makes it, with its owner. */
	if (mkdir(edit->folder, S_IRWXU | S_IRGRP | S_IXGRP) != 0 && errno != EEXIST) {
		fail(edit, errno);
		return;
	}
	edit->before = read_text(edit->path, true);
	if (!edit->before) {
		fail(edit, errno);
		return;
	}
	if (asprintf(&written_to, "%s.new", edit->path) < 0) {
		fail(edit, ENOMEM);
		return;
	}
	list_formers(edit, false);
	/* The present text gets a second name, that of a former one, before the new one takes its
	 * place: so each has a name at any moment. */
	kept = former_path(edit, edit->former_count > 0 ? edit->numbers[0] + 1 : 1);
	error = kept ? 0 : ENOMEM;
	if (error == 0 && link(edit->path, kept) != 0)
		error = errno;
	/* Before the first one there was none: to go back to that is to have an empty one. */
	if (kept && error == ENOENT) {
		fd = open(kept, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC,
		          S_IRUSR | S_IWUSR | S_IRGRP);
		error = fd < 0 ? errno : 0;
		if (fd >= 0)
			close(fd);
	}
	free(kept);
	if (error == 0)
		error = disk_replace_file(edit->path, written_to, edit->text);
	free(written_to);
	list_formers(edit, true);
	if (error != 0)
		fail(edit, error);
	edit->version = db_config_signature(edit->service->path, NULL);
}

static void work(struct disk_job *job)
{
	struct edit *edit = (struct edit *)job;
	struct db_config_reading reading;
	size_t size = 0;
	FILE *errors;

	edit->version = db_config_signature(edit->service->path, NULL);
	if (edit->kind == DB_EDIT_SET && edit->version != edit->given)
		edit->end = DB_EDIT_CHANGED;
	else if (edit->kind == DB_EDIT_READ) {
		char *path = edit->former != 0 ? former_path(edit, edit->former) :
		                                 strdup(edit->path);

		list_formers(edit, false);
		errno = ENOMEM;
		edit->text = path ? read_text(path, edit->former == 0) : NULL;
		if (!edit->text)
			fail(edit, errno);
		free(path);
	} else if (edit->writes) {
		write_text(edit);
	} else {
		errors = open_memstream(&edit->messages, &size);
		if (errors) {
			(void)db_config_read(edit->service->path, edit->text, errors, &reading);
			edit->config = reading.config;
			reading.config = NULL;
			db_config_reading_clear(&reading);
		}
		if (!errors || fclose(errors) != 0)
			fail(edit, ENOMEM);
		else if (!edit->config)
			edit->end = DB_EDIT_WRONG;
	}
}

/* --- the answer ------------------------------------------------------------------------------- */

/* Length of the common lines at the end of texts of which `first` bytes are not looked at. */
static size_t same_behind(const char *a, const char *b, size_t first)
{
	size_t length_a = strlen(a), length_b = strlen(b);
	size_t most = length_a < length_b ? length_a - first : length_b - first;
	size_t lines = 0;

	for (size_t i = 1; i <= most && a[length_a - i] == b[length_b - i]; i++) {
		/* A line begins here in both. */
		if ((i == length_a - first || a[length_a - i - 1] == '\n') &&
		    (i == length_b - first || b[length_b - i - 1] == '\n'))
			lines = i;
	}
	return lines;
}

static void put_lines(FILE *out, char sign, const char *text, size_t length)
{
	while (length > 0) {
		size_t line = strcspn(text, "\n");

		line = line < length ? line : length;
		fprintf(out, "%c%.*s\n", sign, (int)line, text);
		line += line < length;
		text += line;
		length -= line;
	}
}

/* For a READ the running configuration, for a SET the lines that it has changed. To be freed; null:
 * there is nothing to show, or no memory. */
static char *describe(const struct edit *edit)
{
	const char *before = edit->before;
	const char *after = edit->text;
	char *text = NULL;
	size_t first = 0; /* length of the common lines at the beginning */
	size_t size = 0;
	size_t last;
	FILE *out;

	if (edit->kind != DB_EDIT_READ && (!before || edit->end != DB_EDIT_DONE))
		return NULL;
	out = open_memstream(&text, &size);
	if (!out)
		return NULL;
	if (edit->kind == DB_EDIT_READ) {
		db_config_write(edit->service->plant->edition->config, out);
	} else {
		for (size_t i = 0; before[i] && before[i] == after[i]; i++)
			first = before[i] == '\n' ? i + 1 : first;
		last = same_behind(before, after, first);
		put_lines(out, '-', before + first, strlen(before) - first - last);
		put_lines(out, '+', after + first, strlen(after) - first - last);
	}
	return fclose(out) == 0 ? text : (free(text), NULL);
}

struct effects {
	struct db_edit_effect *list;
	size_t count;
	bool failed;
};

static void add_effect(void *context, const struct db_bus_config *bus,
                       const struct plant_drive *drive, const char *text)
{
	struct effects *effects = context;
	struct db_edit_effect *more = realloc(effects->list, (effects->count + 1) * sizeof(*more));
	struct db_snapshot snapshot = { 0 };

	if (!more) {
		effects->failed = true;
		return;
	}
	if (drive)
		db_axis_read(drive->axis, &snapshot);
	effects->list = more;
	more[effects->count++] = (struct db_edit_effect){
		.bus = bus->name,
		.drive = drive ? drive->config->name : NULL,
		.text = text,
		.moves = snapshot.feedback.state >= DB_AXIS_DISCRETE_MOTION &&
		         snapshot.feedback.state <= DB_AXIS_STOPPING,
	};
}

static void answer(struct edit *edit, struct effects *effects)
{
	struct db_edit_answer answer = {
		.kind = edit->kind,
		.end = edit->end,
		.error = edit->error,
		.path = edit->path,
		.version = edit->version,
		.messages = edit->messages ? edit->messages : "",
		.text = edit->text,
		.former_count = edit->former_count,
		.effects = effects->list,
		.effect_count = effects->count,
	};
	char *text = describe(edit);

	answer.running = edit->kind == DB_EDIT_READ ? text : NULL;
	answer.change = edit->kind == DB_EDIT_READ ? NULL : text;
	for (size_t i = 0; i < edit->former_count; i++)
		answer.formers[i] = (struct db_edit_former){ .number = edit->numbers[i],
			                                     .time_us = edit->times_us[i] };
	db_control_socket_edited(edit->service->control, &answer);
	free(text);
}

/* Compares what was read with what runs. False: the client gets the answer now. */
static bool judge(struct edit *edit)
{
	const struct db_config *running = edit->service->plant->edition->config;
	char *why = NULL;
	char *all;

	if (edit->end != DB_EDIT_DONE || !edit->config)
		return false;
	/* A reload would refuse it. */
	if (db_config_is_cut(running, edit->config, &why)) {
		edit->end = DB_EDIT_WRONG;
		if (asprintf(&all, "%s%s\n", edit->messages ? edit->messages : "",
		             why ? why : strerror(ENOMEM)) >= 0) {
			free(edit->messages);
			edit->messages = all;
		}
	}
	free(why);
	return edit->end == DB_EDIT_DONE && edit->kind == DB_EDIT_SET && !edit->writes;
}

static void done(struct disk_job *job)
{
	struct edit *edit = (struct edit *)job;
	struct service *service = edit->service;
	struct effects effects = { 0 };

	if (judge(edit)) {
		edit->writes = true;
		if (configuration_work(service, &edit->job))
			return;
		fail(edit, EBUSY);
	}
	if (edit->config && edit->end == DB_EDIT_DONE) {
		struct db_config *config = edit->config;
		struct plant *next = NULL;
		int error;

		edit->config = NULL;
		/* Until it is answered: the effects' texts are of `next`. */
		error = reload_foresee(service, config, &next, add_effect, &effects);
		if (error != 0 && edit->kind == DB_EDIT_CHECK)
			fail(edit, -error);
		if (effects.failed && edit->kind == DB_EDIT_CHECK)
			fail(edit, ENOMEM);
		answer(edit, &effects);
		plant_free(next, service->plant);
	} else {
		answer(edit, &effects);
	}
	free(effects.list);
	edit_end(service);
}

/* --- beginning and end ------------------------------------------------------------------------ */

int edit_begin(void *context, const struct db_edit_request *request)
{
	struct service *service = context;
	struct edit *edit;
	char *slash;

	if (service->edit || service->reload)
		return -EBUSY;
	if (request->kind == DB_EDIT_SET && !service->plant->edition->config->control.edit)
		return -EPERM;
	edit = calloc(1, sizeof(*edit));
	service->edit = edit;
	if (!edit)
		return -ENOMEM;
	*edit = (struct edit){
		.job = { .work = work, .done = done },
		.service = service,
		.kind = request->kind,
		.former = request->former,
		.given = request->version,
		.text = request->text ? strdup(request->text) : NULL,
		.path = db_config_edited_path(service->path),
	};
	slash = edit->path ? strrchr(edit->path, '/') : NULL;
	edit->folder = slash ? strndup(edit->path, (size_t)(slash - edit->path) + 1) : NULL;
	if (edit->folder && (edit->text || !request->text) &&
	    configuration_work(service, &edit->job))
		return 0;
	edit_end(service);
	return -ENOMEM;
}

void edit_end(struct service *service)
{
	struct edit *edit = service->edit;

	if (!edit)
		return;
	service->edit = NULL;
	db_config_free(edit->config);
	free(edit->messages);
	free(edit->text);
	free(edit->before);
	free(edit->folder);
	free(edit->path);
	free(edit);
}
