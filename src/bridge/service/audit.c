/* SPDX-License-Identifier: Apache-2.0 */
/* The audit trail of the service, and histories that outlive a restart with it. */
#include "service/service_private.h"

#include "drivebridge/audit.h"
#include "drivebridge/clock.h"
#include "drivebridge/command_table.h"
#include "drivebridge/version.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define FOLDER_NAME "audit"

/* --- records ---------------------------------------------------------------------------------- */

uint32_t audit_post(void *context, const struct db_client *client,
                    const struct db_audit_entry *entry)
{
	const struct service *service = context;
	struct db_audit_entry complete = *entry;
	struct db_control_socket_names names = { 0 };
	const char *certificate;
	const char *role;

	complete.time_us = db_clock_wall_us();
	if (client) {
		memcpy(complete.address, client->address, sizeof(complete.address));
		complete.port = client->port;
		complete.endpoint = db_modbus_endpoint_name(
			&service->plant->edition->config->modbus, client->endpoint);
		if (db_client_is_session(client->id))
			db_control_socket_names(service->control, client, &names);
		if (db_server_certificate(service->server, client->address, &certificate, &role)) {
			names.login = certificate;
			names.user = role;
		}
		complete.login = names.login;
		complete.user = complete.user ? complete.user : names.user;
		complete.from = complete.from ? complete.from : names.from;
	}
	return db_audit_post(service->audit, &complete, service_now(service));
}

void audit_post_end(void *context, uint32_t record, const char *drive, enum db_result result,
                    db_time took)
{
	const struct service *service = context;

	db_audit_end(service->audit, record, drive, result, db_time_us32(took), db_clock_wall_us());
}

/* --- histories -------------------------------------------------------------------------------- */

/* A command or write of an earlier run. */
struct recalled {
	uint64_t number;
	char drive[64];
	char bus[64];
	char param[64]; /* "": a command */
	struct db_recalled recalled;
};

struct recollection {
	struct service *service;
	struct recalled *places;
	size_t count;
	size_t room;
};

/* The one with this number, the newest ones being last; null. */
static struct recalled *find(const struct recollection *past, uint64_t number)
{
	for (size_t i = past->count; i > 0 && past->places[i - 1].number >= number; i--) {
		if (past->places[i - 1].number == number)
			return &past->places[i - 1];
	}
	return NULL;
}

static void recall(void *context, const struct db_audit_entry *entry)
{
	struct recollection *past = context;
	struct recalled *place = entry->of != 0 ? find(past, entry->of) : NULL;
	struct db_client_session session;

	if (place && entry->kind == DB_AUDIT_END) {
		place->recalled.entry.result = (uint16_t)entry->result;
		place->recalled.entry.duration_us = (uint32_t)entry->took_us;
	} else if (place && place->recalled.entry.repeats + entry->count <= UINT16_MAX) {
		/* A stop that it served, too, or what was like it. */
		place->recalled.entry.repeats = (uint16_t)(place->recalled.entry.repeats +
		                                           (entry->count > 0 ? entry->count : 1));
	}
	if (entry->of != 0 || entry->drive[0] == '\0' ||
	    (entry->kind != DB_AUDIT_COMMAND &&
	     (entry->kind != DB_AUDIT_WRITE || entry->value_count == 0)))
		return;
	if (past->count == past->room) {
		size_t room = past->room > 0 ? 2 * past->room : 256;
		struct recalled *more = realloc(past->places, room * sizeof(*more));

		if (!more)
			return;
		past->places = more;
		past->room = room;
	}
	place = &past->places[past->count++];
	*place = (struct recalled){
		.number = entry->number,
		.recalled = {
			.node = entry->node,
			.axis = entry->axis,
			.args = entry->args,
			.entry = {
				.timestamp_us = entry->time_us,
				.command_id = entry->id,
				.command = entry->command,
				.result = (uint16_t)entry->result,
			},
		},
	};
	snprintf(place->drive, sizeof(place->drive), "%s", entry->drive);
	snprintf(place->bus, sizeof(place->bus), "%s", entry->bus);
	/* A session of an earlier run has another number in this one. */
	memcpy(place->recalled.entry.address, entry->address,
	       sizeof(place->recalled.entry.address));
	place->recalled.entry.port = entry->port;
	if (db_client_session_of_address(entry->address, &session))
		db_control_socket_recall(past->service->control, session.user, entry->login,
		                         entry->user, place->recalled.entry.address);
	if (entry->value_count > 0) {
		snprintf(place->param, sizeof(place->param), "%s", entry->values[0].name);
		place->recalled.value = entry->values[0].secret ? 0 : entry->values[0].number;
	}
}

/* --- beginning and end ------------------------------------------------------------------------ */

static void post_service(struct service *service, const char *what)
{
	(void)audit_post(service, NULL,
	                 &(struct db_audit_entry){
				 .kind = DB_AUDIT_SERVICE,
				 .what = what,
				 .text = "drivebridged " DB_VERSION,
			 });
}

int audit_begin(struct service *service)
{
	const struct db_control_config *config = &service->plant->edition->config->control;
	struct recollection past = { .service = service };
	char *folder = NULL;
	struct db_audit_setup setup = {
		.log = service->log,
		.on = !config->audit_off,
		.mib = config->audit_mib,
		.past = recall,
		.context = &past,
	};
	int error;

	(void)service_state_path(FOLDER_NAME, &folder);
	setup.folder = folder;
	error = db_audit_new(&setup, service_now(service), &service->audit);
	free(folder);
	for (size_t i = 0; error == 0 && i < past.count; i++) {
		struct recalled *place = &past.places[i];

		/* The service ended before its end was known. */
		if (place->recalled.entry.result == DB_RESULT_PENDING)
			place->recalled.entry.result = DB_RESULT_INDETERMINATE;
		/* The places have moved as they grew. */
		place->recalled.drive = place->drive;
		place->recalled.bus = place->bus;
		place->recalled.param = place->param[0] ? place->param : NULL;
		db_registers_recall(service->registers, &place->recalled);
	}
	if (error == 0)
		post_service(service, "begins");
	free(past.places);
	return error;
}

void audit_end(struct service *service)
{
	if (service->audit)
		post_service(service, "ends");
	service->log_in_use = !db_audit_free(service->audit);
	service->audit = NULL;
}
