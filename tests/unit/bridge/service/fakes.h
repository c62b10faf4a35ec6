/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Buses without threads, a server without sockets and a log in memory, in the place of the real
 * ones: the linker finds these functions first. What is asked of them stands in a journal, in
 * order. To be included once in a test.
 */
#ifndef DRIVEBRIDGE_TESTS_SERVICE_FAKES_H
#define DRIVEBRIDGE_TESTS_SERVICE_FAKES_H

#include "drivebridge/audit.h"
#include "drivebridge/bus.h"
#include "drivebridge/control_socket.h"
#include "drivebridge/health.h"
#include "drivebridge/log.h"
#include "drivebridge/server.h"
#include "service/service_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cmocka.h>

static struct {
	char journal[16384];
	int prepare_error; /* what the server says to other settings */
	int start_error;   /* what a bus says to its start */
	unsigned descriptors_kept;
	bool early;
} fake;

__attribute__((format(printf, 1, 2))) static void note(const char *format, ...)
{
	size_t used = strlen(fake.journal);
	va_list arguments;

	va_start(arguments, format);
	vsnprintf(fake.journal + used, sizeof(fake.journal) - used, format, arguments);
	va_end(arguments);
	assert_true(strlen(fake.journal) + 2 < sizeof(fake.journal));
	strcat(fake.journal, "\n");
}

/* A line with this in the journal, behind the last one that was expected; fails when there is
 * none. */
static const char *expected_to_here;

static void expect_next(const char *fragment)
{
	const char *begin = expected_to_here ? expected_to_here : fake.journal;
	const char *found = strstr(begin, fragment);

	if (!found)
		fail_msg("'%s' is not in\n%s\nbehind\n%.*s", fragment, begin,
		         (int)(begin - fake.journal), fake.journal);
	expected_to_here = found + strlen(fragment);
}

static void expect_never(const char *fragment)
{
	if (strstr(fake.journal, fragment))
		fail_msg("'%s' is in\n%s", fragment, fake.journal);
}

static void clear_journal(void)
{
	fake.journal[0] = '\0';
	expected_to_here = NULL;
}

/* --- the log ---------------------------------------------------------------------------------- */

/* No tools either. */
int db_control_socket_new(const struct db_control_socket_setup *setup,
                          struct db_control_socket **control)
{
	(void)setup;
	*control = NULL;
	return 0;
}

void db_control_socket_free(struct db_control_socket *control)
{
	(void)control;
}

void db_control_socket_change(struct db_control_socket *control,
                              const struct db_control_config *config,
                              const struct db_log_source *log)
{
	(void)control;
	(void)config;
	(void)log;
}

void db_control_socket_answer(struct db_control_socket *control, struct db_write_token token,
                              enum db_result result)
{
	(void)control;
	(void)token;
	(void)result;
}

void db_control_socket_reloaded(struct db_control_socket *control, const char *errors)
{
	(void)control;
	(void)errors;
}

void db_control_socket_catch_up(struct db_control_socket *control)
{
	(void)control;
}

void db_control_socket_words(const struct db_control_socket *control, const uint8_t address[16],
                             struct db_client_words *words)
{
	(void)control;
	db_client_words_init(words, address, "", "");
}

void db_control_socket_names(const struct db_control_socket *control,
                             const struct db_client *client, struct db_control_socket_names *names)
{
	(void)control;
	(void)client;
	(void)names;
}

void db_control_socket_recall(struct db_control_socket *control, uint32_t user, const char *login,
                              const char *named, uint8_t address[16])
{
	(void)control;
	(void)user;
	(void)login;
	(void)named;
	(void)address;
}

/* There is no audit trail. */

int db_audit_new(const struct db_audit_setup *setup, db_time now, struct db_audit **audit)
{
	(void)setup;
	(void)now;
	*audit = NULL;
	return 0;
}

bool db_audit_free(struct db_audit *audit)
{
	(void)audit;
	return true;
}

void db_audit_change(struct db_audit *audit, bool on, unsigned mib)
{
	(void)audit;
	(void)on;
	(void)mib;
}

uint32_t db_audit_post(struct db_audit *audit, const struct db_audit_entry *entry, db_time now)
{
	(void)audit;
	(void)entry;
	(void)now;
	return 0;
}

void db_audit_end(struct db_audit *audit, uint32_t number, const char *drive, enum db_result result,
                  uint32_t took_us, uint64_t time_us)
{
	(void)audit;
	(void)number;
	(void)drive;
	(void)result;
	(void)took_us;
	(void)time_us;
}

/* Nor values of health, nor alarms. */

int db_health_new(const struct db_health_setup *setup, db_time now, struct db_health **health)
{
	(void)setup;
	(void)now;
	*health = NULL;
	return 0;
}

bool db_health_free(struct db_health *health, db_time now, uint64_t wall_us)
{
	(void)health;
	(void)now;
	(void)wall_us;
	return true;
}

void db_health_change(struct db_health *health, bool on)
{
	(void)health;
	(void)on;
}

int db_health_set_drives(struct db_health *health, const struct db_health_drive *drives,
                         size_t count)
{
	(void)health;
	(void)drives;
	(void)count;
	return 0;
}

void db_health_sample(struct db_health *health, size_t place, const struct db_snapshot *snapshot,
                      bool has_temperature, db_time now)
{
	(void)health;
	(void)place;
	(void)snapshot;
	(void)has_temperature;
	(void)now;
}

void db_health_tick(struct db_health *health, db_time now, uint64_t wall_us)
{
	(void)health;
	(void)now;
	(void)wall_us;
}

void db_health_see(struct db_health *health, const struct db_alarm_seen *seen)
{
	(void)health;
	(void)seen;
}

void db_health_seen(struct db_health *health, uint64_t wall_us)
{
	(void)health;
	(void)wall_us;
}

int db_log_new(struct db_log **log)
{
	*log = NULL;
	return 0;
}

void db_log_free(struct db_log *log)
{
	(void)log;
}

void db_log_leave(struct db_log *log)
{
	(void)log;
}

void db_log(const struct db_log_source *source, db_time now, enum db_event event,
            const struct db_log_about *about, const char *format, ...)
{
	char text[512];
	va_list arguments;

	(void)now;
	va_start(arguments, format);
	vsnprintf(text, sizeof(text), format, arguments);
	va_end(arguments);
	note("log %s %s/%s/%s: %s", db_event_name(event), source->bus ? source->bus : "-",
	     about && about->drive ? about->drive : "-",
	     about && about->client ? about->client : "-", text);
}

/* --- buses ------------------------------------------------------------------------------------ */

#define CHANGED_MAX 8

struct db_change {
	uint16_t leaving[CHANGED_MAX];
	size_t leaving_count;
	uint16_t coming[CHANGED_MAX];
	size_t coming_count;
};

struct db_bus {
	const struct db_bus_config *config;
	size_t drive_count;
	int fd;
	uint32_t beats;
	bool ended;
	struct db_change *change; /* handed over */
	bool carried_out;
	struct db_request request;
	bool completed; /* the request has ended and waits to be fetched */
	struct db_bus_stats stats;
	struct db_trace *trace;
};

int db_bus_new(const struct db_bus_config *config, const struct db_bus_drive *drives,
               size_t drive_count, struct db_log *log, struct db_bus **bus)
{
	(void)drives;
	(void)log;
	*bus = calloc(1, sizeof(**bus));
	assert_non_null(*bus);
	(*bus)->config = config;
	(*bus)->drive_count = drive_count;
	(*bus)->trace = db_trace_new(4096);
	assert_non_null((*bus)->trace);
	(*bus)->fd = eventfd(0, EFD_CLOEXEC);
	assert_true((*bus)->fd >= 0);
	note("make bus %s of %zu", config->name, drive_count);
	return 0;
}

int db_bus_start(struct db_bus *bus)
{
	note("start %s", bus->config->name);
	return fake.start_error;
}

void db_bus_stop(struct db_bus *bus)
{
	bus->ended = true;
}

void db_bus_ask_end(struct db_bus *bus)
{
	note("ask end of %s", bus->config->name);
}

bool db_bus_has_ended(const struct db_bus *bus)
{
	return bus->ended;
}

void db_bus_free(struct db_bus *bus)
{
	if (!bus)
		return;
	note("free %s", bus->config->name);
	db_bus_change_free(bus->change);
	close(bus->fd);
	db_trace_free(bus->trace);
	free(bus);
}

struct db_request *db_bus_submit(struct db_bus *bus, const struct db_request *request)
{
	note("submit to %s", bus->config->name);
	bus->request = *request;
	return &bus->request;
}

void db_bus_release(struct db_request *request)
{
	(void)request;
}

void db_bus_gather(struct db_bus *bus, bool gathers)
{
	note("%s %s", gathers ? "gather for" : "release to", bus->config->name);
}

const struct db_trace *db_bus_trace(const struct db_bus *bus)
{
	return bus->trace;
}

int db_bus_completion_fd(const struct db_bus *bus)
{
	return bus->fd;
}

struct db_request *db_bus_completion(struct db_bus *bus)
{
	if (!bus->completed)
		return NULL;
	bus->completed = false;
	note("fetched of %s", bus->config->name);
	return &bus->request;
}

int db_bus_change_new(struct db_bus *bus, const uint16_t *leaving, size_t leaving_count,
                      const struct db_bus_drive *coming, size_t coming_count,
                      struct db_change **change)
{
	(void)bus;
	assert_true(leaving_count <= CHANGED_MAX && coming_count <= CHANGED_MAX);
	*change = calloc(1, sizeof(**change));
	assert_non_null(*change);
	(*change)->leaving_count = leaving_count;
	(*change)->coming_count = coming_count;
	for (size_t i = 0; i < leaving_count; i++)
		(*change)->leaving[i] = leaving[i];
	for (size_t i = 0; i < coming_count; i++)
		(*change)->coming[i] = coming[i].drive;
	return 0;
}

void db_bus_change(struct db_bus *bus, struct db_change *change)
{
	note("change %s: %zu leave, %zu come", bus->config->name, change->leaving_count,
	     change->coming_count);
	bus->change = change;
}

struct db_change *db_bus_take_changed(struct db_bus *bus)
{
	struct db_change *change = bus->carried_out ? bus->change : NULL;

	if (change)
		bus->change = NULL;
	bus->carried_out = false;
	return change;
}

void db_bus_change_free(struct db_change *change)
{
	free(change);
}

uint32_t db_bus_heartbeat(const struct db_bus *bus)
{
	return bus->beats;
}

void db_bus_read_stats(const struct db_bus *bus, struct db_bus_stats *stats)
{
	*stats = bus->stats;
}

/* --- the server ------------------------------------------------------------------------------- */

struct db_server {
	const struct db_modbus_config *config;
};

struct db_server_change {
	const struct db_modbus_config *config;
};

int db_server_new(struct sd_event *loop, const struct db_modbus_config *config,
                  const struct db_backend *backend, void *context, const struct db_log_source *log,
                  struct db_server **result, const char **where)
{
	*where = NULL;
	(void)loop;
	(void)backend;
	(void)context;
	(void)log;
	*result = calloc(1, sizeof(**result));
	assert_non_null(*result);
	(*result)->config = config;
	return 0;
}

void db_server_free(struct db_server *server)
{
	free(server);
}

int db_server_prepare(struct db_server *server, const struct db_modbus_config *config,
                      struct db_server_change **change, const char **where)
{
	*where = NULL;
	(void)server;
	if (fake.prepare_error != 0)
		return fake.prepare_error;
	*change = calloc(1, sizeof(**change));
	assert_non_null(*change);
	(*change)->config = config;
	return 0;
}

void db_server_apply(struct db_server *server, struct db_server_change *change)
{
	note("server takes %s", change->config->listen);
	server->config = change->config;
	free(change);
}

void db_server_change_free(struct db_server_change *change)
{
	free(change);
}

void db_server_catch_up(struct db_server *server)
{
	(void)server;
}

void db_server_answer(struct db_server *server, struct db_write_token token, uint8_t exception)
{
	(void)server;
	note("answer %u: %02X", (unsigned)token.sequence, exception);
}

void db_server_keep_descriptors(struct db_server *server, unsigned count)
{
	(void)server;
	fake.descriptors_kept = count;
}

void db_server_set_rights(struct db_server *server, const struct db_rights *rights)
{
	(void)server;
	(void)rights;
}

bool db_server_is_early(const struct db_server *server, uint32_t endpoint)
{
	(void)endpoint;
	(void)server;
	return fake.early;
}

uint16_t db_server_port(const struct db_server *server, uint32_t endpoint)
{
	(void)endpoint;
	(void)server;
	return 1502;
}

void db_server_stats(const struct db_server *server, struct db_server_stats *stats)
{
	(void)server;
	*stats = (struct db_server_stats){ .clients = 3 };
}

size_t db_server_clients(const struct db_server *server, struct db_server_client *clients,
                         size_t max)
{
	(void)server;
	(void)clients;
	(void)max;
	return 0;
}

void db_server_refused(struct db_server *server, const struct db_client *client,
                       enum db_refusal kind)
{
	(void)server;
	(void)client;
	note("refused %d", (int)kind);
}

bool db_server_certificate(const struct db_server *server, const uint8_t address[16],
                           const char **name, const char **role)
{
	(void)server;
	(void)address;
	(void)name;
	(void)role;
	return false;
}

bool db_server_secure_status(const struct db_server *server, struct db_secure_status *status)
{
	(void)server;
	(void)status;
	return false;
}

#endif
