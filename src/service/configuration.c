/* SPDX-License-Identifier: Apache-2.0 */
#include "service/configuration.h"

#include "drivebridge/config.h"
#include "service/disk.h"
#include "service/state.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <time.h>

#define COPY_NAME "last-good-configuration"

struct configuration {
	struct disk *disk; /* null: it could not be had, so nothing of the files is known */
	sd_event_source *news;
	enum db_configuration_state state;
	uint64_t since_us;
	char *messages;     /* null: none */
	bool keeps;         /* there is a place for copies */
	bool keeping_fails; /* which was logged */
};

static uint64_t wall_us(void)
{
	struct timespec now;

	clock_gettime(CLOCK_REALTIME, &now);
	return (uint64_t)now.tv_sec * 1000000 + (uint64_t)now.tv_nsec / 1000;
}

/* --- the start ------------------------------------------------------------------------------------- */

char *configuration_copy_path(void)
{
	const char *folders = getenv("STATE_DIRECTORY");
	char *path;

	/* There may be several, of which the first one is ours. */
	if (!folders || folders[0] != '/' ||
	    asprintf(&path, "%.*s/" COPY_NAME, (int)strcspn(folders, ":"), folders) < 0)
		return NULL;
	return path;
}

/* To be freed by who called; null when there is none that can be used. */
static struct db_config *load_copy(const char *path)
{
	char *copy = configuration_copy_path();
	struct db_config *config = NULL;

	if (copy && db_config_load_copy(copy, path, stderr, &config) != 0)
		config = NULL;
	free(copy);
	return config;
}

bool configuration_load(const char *path, bool last_good, struct configuration_start *start)
{
	size_t size = 0;
	FILE *errors;

	*start = (struct configuration_start){ .signature = db_config_signature(path) };
	errors = open_memstream(&start->why, &size);
	if (!errors)
		return false;
	if (db_config_load_with_copy(path, errors, &start->config, &start->copy) != 0)
		start->config = NULL;
	fclose(errors);
	/* Warnings, or what is wrong. */
	fputs(start->why, stderr);
	if (start->config) {
		free(start->why);
		start->why = NULL;
	} else if (last_good) {
		start->config = load_copy(path);
	}
	if (!start->config)
		configuration_start_clear(start);
	return start->config != NULL;
}

void configuration_start_clear(struct configuration_start *start)
{
	db_config_free(start->config);
	free(start->copy);
	free(start->why);
	*start = (struct configuration_start){ 0 };
}

/* --- what is known --------------------------------------------------------------------------------- */

/* False when that was known. */
static bool set_state(struct configuration *known, enum db_configuration_state state,
                      const char *messages)
{
	const char *before = known->messages ? known->messages : "";
	size_t length = strlen(messages);

	while (length > 0 && messages[length - 1] == '\n')
		length--;
	if (known->state == state && strlen(before) == length &&
	    memcmp(before, messages, length) == 0)
		return false;
	/* gcc's analyzer takes it for lost: it is freed with the rest of what is known. */
	free(known->messages);
	known->messages = length > 0 ? strndup(messages, length) : NULL;
	known->state = state;
	known->since_us = wall_us();
	return true;
}

static void log_lines(const struct service *service, enum db_event event, const char *lines)
{
	while (*lines) {
		int length = (int)strcspn(lines, "\n");

		db_log(&service->log, service_now(service), event, NULL, "%.*s", length, lines);
		lines += length;
		lines += *lines == '\n';
	}
}

/* What a restart would do with the files as they are now. */
static const char *describe_restart(const struct configuration *known)
{
	return known->keeps ? "a restart would run the last good configuration instead" :
	                      "a restart would not come up with it";
}

static void take_wrong(struct service *service, const char *messages)
{
	struct configuration *known = service->configuration;
	bool from_copy = known->state == DB_CONFIGURATION_LAST_GOOD;

	if (!set_state(known, from_copy ? known->state : DB_CONFIGURATION_REFUSED, messages))
		return;
	log_lines(service, DB_EVENT_CONFIG_WRONG, messages);
	db_log(&service->log, service_now(service), DB_EVENT_CONFIG_WRONG, NULL,
	       "the configuration on disk has an error: %s; what runs goes on",
	       describe_restart(known));
}

static void take_changed(struct service *service)
{
	struct configuration *known = service->configuration;
	bool from_copy = known->state == DB_CONFIGURATION_LAST_GOOD;

	if (set_state(known, from_copy ? known->state : DB_CONFIGURATION_CHANGED,
	              "the configuration on disk has changed and is right, but is not loaded yet: "
	              "systemctl reload drivebridge"))
		db_log(&service->log, service_now(service), DB_EVENT_CONFIG_CHANGED, NULL, "%s",
		       known->messages ? known->messages : "");
}

static void take_files(struct service *service, const struct disk_news *news)
{
	struct configuration *known = service->configuration;
	const struct db_config *running = service->plant->edition->config;
	char *cut = NULL;

	if (!news->config)
		take_wrong(service, news->messages ? news->messages : "");
	else if (db_config_is_cut(running, news->config, &cut))
		take_wrong(service, cut ? cut : "");
	else if (!db_config_same(running, news->config))
		take_changed(service);
	else if (set_state(known, DB_CONFIGURATION_IN_FORCE, ""))
		db_log(&service->log, service_now(service), DB_EVENT_CONFIG_CHANGED, NULL,
		       "the configuration on disk is right and says what runs");
	free(cut);
}

static void take_kept(struct service *service, int error)
{
	struct configuration *known = service->configuration;

	if (error != 0 && !known->keeping_fails)
		db_log(&service->log, service_now(service), DB_EVENT_CONFIG_UNKEPT, NULL,
		       "cannot keep the last good configuration: %s; a start with a wrong file "
		       "would have an older one or none",
		       strerror(error));
	known->keeping_fails = error != 0;
}

static int on_news(sd_event_source *source, int fd, uint32_t events, void *context)
{
	struct service *service = context;
	struct disk_news news;

	(void)source;
	(void)fd;
	(void)events;
	if (!disk_take_news(service->configuration->disk, &news))
		return 0;
	if (news.kept)
		take_kept(service, news.error);
	/* A reload that is under way says itself what comes of it. */
	if (news.read && !service->reload)
		take_files(service, &news);
	db_config_free(news.config);
	free(news.messages);
	return 0;
}

void configuration_loaded(struct service *service, uint64_t signature, char *copy)
{
	struct configuration *known = service->configuration;

	if (!known) {
		free(copy);
		return;
	}
	set_state(known, DB_CONFIGURATION_IN_FORCE, "");
	disk_expect(known->disk, signature);
	if (copy)
		disk_keep(known->disk, copy);
}

void configuration_refused(struct service *service, uint64_t signature, const char *reasons)
{
	struct configuration *known = service->configuration;

	if (!known)
		return;
	set_state(known,
	          known->state == DB_CONFIGURATION_LAST_GOOD ? known->state :
	                                                       DB_CONFIGURATION_REFUSED,
	          reasons);
	disk_expect(known->disk, signature);
}

struct db_configuration_report configuration_report(const struct service *service)
{
	const struct configuration *known = service->configuration;

	if (!known)
		return (struct db_configuration_report){ .messages = "" };
	return (struct db_configuration_report){
		.state = known->state,
		.since_us = known->since_us,
		.messages = known->messages ? known->messages : "",
	};
}

/* --- beginning and end ----------------------------------------------------------------------------- */

static void take_start(struct service *service, struct configuration_start *start)
{
	struct configuration *known = service->configuration;

	if (start->why) {
		set_state(known, DB_CONFIGURATION_LAST_GOOD, start->why);
		log_lines(service, DB_EVENT_CONFIG_LAST_GOOD, start->why);
		db_log(&service->log, service_now(service), DB_EVENT_CONFIG_LAST_GOOD, NULL,
		       "%s has an error, so the LAST GOOD configuration runs instead: correct the "
		       "file, check it with drivebridged --config %s --check, then reload",
		       service->path, service->path);
	} else if (start->copy) {
		disk_keep(known->disk, start->copy);
		start->copy = NULL;
	}
}

int configuration_begin(struct service *service, struct configuration_start *start)
{
	struct configuration *known = calloc(1, sizeof *known);
	char *path = configuration_copy_path();
	int error;

	service->configuration = known;
	error = known ? disk_new(service->path, path, start->signature, &known->disk) : -ENOMEM;
	if (error == 0) {
		known->since_us = wall_us();
		known->keeps = path != NULL;
		error = sd_event_add_io(service->loop, &known->news, disk_fd(known->disk), EPOLLIN,
		                        on_news, service);
	}
	if (error >= 0)
		take_start(service, start);
	free(path);
	return error < 0 ? error : 0;
}

void configuration_end(struct service *service)
{
	struct configuration *known = service->configuration;

	if (!known)
		return;
	sd_event_source_disable_unref(known->news);
	disk_free(known->disk);
	free(known->messages);
	free(known);
	service->configuration = NULL;
}
