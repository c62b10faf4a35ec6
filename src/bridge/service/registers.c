/* SPDX-License-Identifier: Apache-2.0 */
#include "service/service_private.h"

#include "drivebridge/clock.h"
#include "drivebridge/command_table.h"
#include "service/configuration.h"

#include <math.h>
#include <stdio.h>
#include <sys/epoll.h>
#include <time.h>

static db_time read_now(void *context)
{
	return service_now(context);
}

static uint64_t read_wall_us(void *context)
{
	(void)context;
	return db_clock_wall_us();
}

static struct db_request *submit_request(void *context, struct db_bus *bus,
                                         const struct db_request *request)
{
	/* A motion may be held, and would have to stand in another run. */
	if (db_command_is_stop(request->command) || db_command_may_move(request->command))
		must_stand_look_soon(context);
	return db_bus_submit(bus, request);
}

static void release_request(void *context, struct db_request *request)
{
	(void)context;
	db_bus_release(request);
}

static void gather_requests(void *context, struct db_bus *bus, bool gathers)
{
	(void)context;
	db_bus_gather(bus, gathers);
}

static void answer_write(void *context, struct db_write_token token, uint8_t exception)
{
	const struct service *service = context;

	db_server_answer(service->server, token, exception);
}

static void answer_session(void *context, struct db_write_token token, enum db_result result)
{
	const struct service *service = context;

	db_control_socket_answer(service->control, token, result);
}

static void read_bus_stats(void *context, struct db_bus *bus, struct db_bus_stats *stats)
{
	(void)context;
	db_bus_read_stats(bus, stats);
}

static size_t list_clients(void *context, struct db_server_client *clients, size_t max)
{
	const struct service *service = context;

	return db_server_clients(service->server, clients, max);
}

static void count_refusal(void *context, const struct db_client *client, enum db_refusal kind)
{
	const struct service *service = context;

	db_server_refused(service->server, client, kind);
}

static void name_client(void *context, const uint8_t address[16], struct db_client_words *words)
{
	const struct service *service = context;
	const char *name;
	const char *role;

	if (db_server_certificate(service->server, address, &name, &role))
		db_client_words_init_certificate(words, address, name, role);
	else
		db_control_socket_words(service->control, address, words);
}

static void describe_client(struct service *service, const struct db_client *client,
                            char text[DB_CLIENT_TEXT_MAX])
{
	struct db_client_words words;

	name_client(service, client->address, &words);
	db_client_words_join(&words, text);
}

static void log_tripped(void *context, const struct db_bus_config *bus_config,
                        const struct db_drive_config *drive, const struct db_client *last)
{
	struct service *service = context;
	struct db_log_source log = service_log_of(service, bus_config);
	char text[DB_CLIENT_TEXT_MAX];
	struct db_log_about about = { .drive = drive->name, .unit = drive->unit };

	if (last->id != DB_CLIENT_NOBODY) {
		describe_client(service, last, text);
		about.client = text;
	}
	db_log(&log, service_now(service), DB_EVENT_WATCHDOG_TRIPPED, &about,
	       "it was silent for too long: the watchdog stops the drive, and nothing moves it "
	       "before "
	       "clear_fault; check the PLC, its program and the network");
	traces_note_tripped(service, bus_config, drive);
}

static void log_lost_hold(void *context, const struct db_bus_config *bus_config,
                          const struct db_drive_config *drive, const struct db_client *holder,
                          bool gone)
{
	struct service *service = context;
	struct db_log_source log = service_log_of(service, bus_config);
	char text[DB_CLIENT_TEXT_MAX];
	struct db_log_about about = { .drive = drive->name, .unit = drive->unit, .client = text };

	describe_client(service, holder, text);
	db_log(&log, service_now(service), DB_EVENT_HOLD_LOST, &about,
	       "%s, so the motion that it held is stopped",
	       gone ? "its connection has ended" : "it no longer sends beats");
}

static void log_refused_write(void *context, const struct db_bus_config *bus_config,
                              const struct db_drive_config *drive, const struct db_client *client,
                              const struct db_refused_write *write)
{
	struct service *service = context;
	struct db_log_source log = service_log_of(service, bus_config);
	bool open = write->result == DB_RESULT_TIMEOUT || write->result == DB_RESULT_INDETERMINATE;
	char text[DB_CLIENT_TEXT_MAX];
	struct db_log_about about = { .drive = drive->name, .unit = drive->unit };
	char what[96];

	if (client) {
		describe_client(service, client, text);
		about.client = text;
	}
	if (write->command != DB_CMD_NONE)
		snprintf(what, sizeof(what), "command %s", db_command_name(write->command));
	else if (write->address != 0)
		snprintf(what, sizeof(what), "a write to register %u", write->address);
	else if (write->param)
		snprintf(what, sizeof(what), "a write of parameter %s", write->param);
	else
		snprintf(what, sizeof(what), "a write");
	if (write->holds_other) {
		db_log(&log, service_now(service), DB_EVENT_COMMAND_REFUSED, &about,
		       "the drive acknowledged %s, but its value is %.9g", what, write->held);
		return;
	}
	if (fabs(write->off) > 0.0) {
		db_log(&log, service_now(service), DB_EVENT_COMMAND_REFUSED, &about,
		       "%s has failed: the drive stands %.9g counts from its target, more than "
		       "in-position-window = %.9g; if that is near enough, set in-position-window "
		       "= %.6g",
		       what, write->off, drive->in_position_window,
		       (fabs(write->off) + 0.5) / drive->counts_per_unit);
		return;
	}
	db_log(&log, service_now(service), DB_EVENT_COMMAND_REFUSED, &about,
	       "%s %s: %s (result %u)", what, open ? "is not confirmed" : "is refused",
	       db_result_name(write->result), (unsigned)write->result);
}

const struct db_registers_ops service_registers_ops = {
	.now = read_now,
	.wall_us = read_wall_us,
	.submit = submit_request,
	.release = release_request,
	.gather = gather_requests,
	.answer = answer_write,
	.answer_session = answer_session,
	.bus_stats = read_bus_stats,
	.server_stats = service_read_server_stats,
	.server_clients = list_clients,
	.configuration = configuration_report,
	.client_words = name_client,
	.refused = count_refusal,
	.write_refused = log_refused_write,
	.audit = audit_post,
	.audit_end = audit_post_end,
	.tripped = log_tripped,
	.hold_lost = log_lost_hold,
};

/* --- completions ------------------------------------------------------------------------------ */

void service_collect(struct plant_bus *bus)
{
	struct service *service = bus->service;
	struct db_request *request;

	while ((request = db_bus_completion(bus->bus)) != NULL) {
		/* A motion that failed might still begin. */
		if (request->result == DB_RESULT_FAILED)
			must_stand_look_soon(service);
		db_registers_complete(service->registers, request, service_now(service));
	}
	traces_look(bus);
}

static int on_completion(sd_event_source *source, int fd, uint32_t events, void *context)
{
	(void)source;
	(void)fd;
	(void)events;
	service_collect(context);
	return 0;
}

int service_watch_bus(struct service *service, struct plant_bus *bus)
{
	return sd_event_add_io(service->loop, &bus->completions, db_bus_completion_fd(bus->bus),
	                       EPOLLIN, on_completion, bus);
}
