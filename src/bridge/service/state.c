/* SPDX-License-Identifier: Apache-2.0 */
#include "service/service_private.h"

#include "drivebridge/loop_clock.h"
#include "identity/rights.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A bus, or a line of a PLC, has its port and the port's lock, and two descriptors to wake others;
 * a reload may open new ones before the old ones are closed. */
#define DESCRIPTORS_PER_BUS 8
/* For the log, the loop, the server, the files that a reload reads, and the tools. */
#define DESCRIPTORS_BESIDE (24 + DB_CONTROL_SOCKET_DESCRIPTORS)

db_time service_now(const struct service *service)
{
	return db_loop_now(service->loop);
}

struct db_log_source service_log_of(const struct service *service,
                                    const struct db_bus_config *bus_config)
{
	return (struct db_log_source){
		.log = service->log.log,
		.bus = bus_config->name,
		.level = bus_config->log,
	};
}

int service_state_path(const char *name, char **path)
{
	const char *folders = getenv("STATE_DIRECTORY");

	*path = NULL;
	/* There may be several, of which the first one is ours. */
	if (!folders || folders[0] != '/' ||
	    asprintf(path, "%.*s/%s", (int)strcspn(folders, ":"), folders, name) >= 0)
		return 0;
	*path = NULL;
	return -ENOMEM;
}

void service_read_server_stats(void *context, struct db_server_stats *stats)
{
	const struct service *service = context;

	db_server_stats(service->server, stats);
}

void service_limit_clients(struct service *service)
{
	const struct db_config *config = service->plant->edition->config;
	unsigned lines = (unsigned)(service->plant->bus_count + config->modbus.line_count);
	struct db_rights rights = db_rights_of(&config->control);

	db_server_keep_descriptors(service->server,
	                           DESCRIPTORS_BESIDE + DESCRIPTORS_PER_BUS * lines);
	db_server_set_rights(service->server,
	                     config->modbus.everybody_writes_here ? NULL : &rights);
}

void service_log_listening(const struct service *service, const struct db_modbus_config *before,
                           const struct db_modbus_config *modbus)
{
	for (size_t i = 0; i < db_modbus_endpoint_count(modbus); i++) {
		const struct db_endpoint_config endpoint = db_modbus_endpoint_at(modbus, i);
		int host = (int)(strrchr(endpoint.listen, ':') - endpoint.listen);
		struct db_endpoint_config old;
		unsigned port;

		if (before && db_modbus_endpoint_find(before, endpoint.number, &old) &&
		    strcmp(old.listen, endpoint.listen) == 0)
			continue;
		if (db_server_is_early(service->server, endpoint.number))
			db_log(&service->log, service_now(service), DB_EVENT_LISTENING, NULL,
			       "this machine does not have the address %.*s yet; clients can "
			       "connect as soon as it has. If it never will: correct listen (ip "
			       "address shows what it has)",
			       host, endpoint.listen);
		port = (unsigned)db_server_port(service->server, endpoint.number);
		if (endpoint.name)
			db_log(&service->log, service_now(service), DB_EVENT_LISTENING, NULL,
			       "listening on %.*s:%u for endpoint %s", host, endpoint.listen, port,
			       endpoint.name);
		else
			db_log(&service->log, service_now(service), DB_EVENT_LISTENING, NULL,
			       "listening on %.*s:%u", host, endpoint.listen, port);
	}
}
