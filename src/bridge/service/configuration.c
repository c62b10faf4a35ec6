/* SPDX-License-Identifier: Apache-2.0 */
#include "service/configuration.h"

#include "drivebridge/clock.h"
#include "drivebridge/config.h"
#include "service/disk.h"
#include "service/service_private.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <time.h>

#define COPY_NAME "last-good-configuration"

struct configuration {
	struct disk *disk; /* null: not available, so nothing is known of the files */
	sd_event_source *news;
	enum db_configuration_state state;
	uint64_t since_us;
	char *messages;     /* null: none */
	char *replaced;     /* the running program or library replaced by an upgrade; null: none */
	bool keeps;         /* there is a place for copies */
	bool keeping_fails; /* writing failed, which was logged */
};

/* --- the start -------------------------------------------------------------------------------- */

bool configuration_load(const char *path, bool last_good, struct configuration_start *start)
{
	struct db_config_reading reading;
	size_t size = 0;
	FILE *errors;

	*start = (struct configuration_start){ 0 };
	errors = open_memstream(&start->why, &size);
	if (!errors)
		return false;
	(void)db_config_read(path, NULL, errors, &reading);
	fclose(errors);
	start->config = reading.config;
	start->copy = reading.copy;
	start->signature = reading.signature;
	free(reading.profiles);
	/* Warnings, or the errors. */
	fputs(start->why, stderr);
	if (start->config) {
		free(start->why);
		start->why = NULL;
	} else if (last_good) {
		/* To be freed by the caller; null when there is none that can be used. */
		struct db_config *config = NULL;
		char *copy;

		(void)service_state_path(COPY_NAME, &copy);
		if (copy && db_config_load_copy(copy, path, stderr, &config) != 0)
			config = NULL;
		free(copy);
		start->config = config;
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

/* --- what is known ---------------------------------------------------------------------------- */

/* False when nothing has changed. */
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
	known->since_us = db_clock_wall_us();
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

static void take_wrong(struct service *service, const char *messages)
{
	struct configuration *known = service->configuration;
	bool from_copy = known->state == DB_CONFIGURATION_LAST_GOOD;

	if (!set_state(known, from_copy ? known->state : DB_CONFIGURATION_REFUSED, messages))
		return;
	log_lines(service, DB_EVENT_CONFIG_WRONG, messages);
	/* The effect of a restart with the present files. */
	db_log(&service->log, service_now(service), DB_EVENT_CONFIG_WRONG, NULL,
	       "the configuration file has an error: %s; the loaded configuration stays in force",
	       known->keeps ? "a restart would load the last good configuration instead" :
	                      "a restart would fail");
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
	else if (!db_config_same(running, news->config)) {
		bool from_copy = known->state == DB_CONFIGURATION_LAST_GOOD;

		if (set_state(known, from_copy ? known->state : DB_CONFIGURATION_CHANGED,
		              "the configuration file has changed and has no error, but is not "
		              "loaded yet: "
		              "systemctl reload drivebridge"))
			db_log(&service->log, service_now(service), DB_EVENT_CONFIG_CHANGED, NULL,
			       "%s", known->messages ? known->messages : "");
	} else if (set_state(known, DB_CONFIGURATION_IN_FORCE, ""))
		db_log(&service->log, service_now(service), DB_EVENT_CONFIG_CHANGED, NULL,
		       "the configuration file has no error and is the loaded one");
	free(cut);
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
	if (news.job) {
		news.job->done(news.job);
		return 0;
	}
	if (news.kept) {
		struct configuration *known = service->configuration;

		if (news.error != 0 && !known->keeping_fails)
			db_log(&service->log, service_now(service), DB_EVENT_CONFIG_UNKEPT, NULL,
			       "cannot store the last good configuration: %s; a start with a file "
			       "that has "
			       "an error would load an older one or fail",
			       strerror(news.error));
		known->keeping_fails = news.error != 0;
	}
	if (news.newer) {
		/* It is told once, so that nothing is lost; gcc's analyzer does not know. */
		free(service->configuration->replaced);
		service->configuration->replaced = news.newer;
		db_log(&service->log, service_now(service), DB_EVENT_RESTART_NEEDED, NULL,
		       "%s was replaced since the start, but the old one still runs: restart the "
		       "service "
		       "when the machine may stand still",
		       news.newer);
	}
	/* A reload in progress reports its own result. */
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

bool configuration_work(struct service *service, struct disk_job *job)
{
	return service->configuration && disk_do(service->configuration->disk, job);
}

struct db_configuration_report configuration_report(void *context)
{
	const struct service *service = context;
	const struct configuration *known = service->configuration;

	if (!known)
		return (struct db_configuration_report){ .messages = "", .replaced = "" };
	return (struct db_configuration_report){
		.state = known->state,
		.since_us = known->since_us,
		.messages = known->messages ? known->messages : "",
		.replaced = known->replaced ? known->replaced : "",
	};
}

/* --- beginning and end ------------------------------------------------------------------------ */

int configuration_begin(struct service *service, struct configuration_start *start)
{
	struct configuration *known = calloc(1, sizeof(*known));
	char *path;
	int error;

	/* The last good configuration is in systemd's StateDirectory. */
	(void)service_state_path(COPY_NAME, &path);
	service->configuration = known;
	error = known ? disk_new(service->path, path, start->signature, &known->disk) : -ENOMEM;
	if (error == 0) {
		known->since_us = db_clock_wall_us();
		known->keeps = path != NULL;
		error = sd_event_add_io(service->loop, &known->news, disk_fd(known->disk), EPOLLIN,
		                        on_news, service);
	}
	if (error >= 0 && start->why) {
		set_state(known, DB_CONFIGURATION_LAST_GOOD, start->why);
		log_lines(service, DB_EVENT_CONFIG_LAST_GOOD, start->why);
		db_log(&service->log, service_now(service), DB_EVENT_CONFIG_LAST_GOOD, NULL,
		       "%s has an error, so the LAST GOOD configuration is loaded instead: correct "
		       "the "
		       "file, check it with drivebridged --config %s --check, then reload",
		       service->path, service->path);
	} else if (error >= 0 && start->copy) {
		disk_keep(known->disk, start->copy);
		start->copy = NULL;
	}
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
	free(known->replaced);
	free(known);
	service->configuration = NULL;
}
