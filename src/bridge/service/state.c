/* SPDX-License-Identifier: Apache-2.0 */
#include "service/service_private.h"

#include "identity/rights.h"

#include <string.h>
#include <sys/epoll.h>

/* A bus, or a line of a PLC, has its port and the port's lock, and two descriptors to wake others;
 * a reload may open new ones before the old ones are closed. */
#define DESCRIPTORS_PER_BUS 8
/* For the log, the loop, the server, the files that a reload reads, and the tools. */
#define DESCRIPTORS_BESIDE (24 + DB_CONTROL_SOCKET_DESCRIPTORS)

db_time service_now(const struct service *service)
{
	uint64_t us = 0;

	sd_event_now(service->loop, CLOCK_MONOTONIC, &us);
	return (db_time)us * DB_NS_PER_US;
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

void service_keep_descriptors(struct service *service)
{
	db_server_keep_descriptors(
		service->server,
		DESCRIPTORS_BESIDE +
			DESCRIPTORS_PER_BUS *
				(unsigned)(service->plant->bus_count +
	                                   service->plant->edition->config->modbus.line_count));
}

void service_set_rights(struct service *service)
{
	const struct db_config *config = service->plant->edition->config;
	struct db_rights rights = db_rights_of(&config->control);

	db_server_set_rights(service->server,
	                     config->modbus.everybody_writes_here ? NULL : &rights);
}

static void log_endpoint(const struct service *service, const struct db_endpoint_config *endpoint)
{
	int host = (int)(strrchr(endpoint->listen, ':') - endpoint->listen);

	if (db_server_is_early(service->server, endpoint->number))
		db_log(&service->log, service_now(service), DB_EVENT_LISTENING, NULL,
		       "this machine does not have the address %.*s yet; clients can connect as "
		       "soon as "
		       "it has. If it never will: correct listen (ip address shows what it has)",
		       host, endpoint->listen);
	if (endpoint->name)
		db_log(&service->log, service_now(service), DB_EVENT_LISTENING, NULL,
		       "listening on %.*s:%u for endpoint %s", host, endpoint->listen,
		       (unsigned)db_server_port(service->server, endpoint->number), endpoint->name);
	else
		db_log(&service->log, service_now(service), DB_EVENT_LISTENING, NULL,
		       "listening on %.*s:%u", host, endpoint->listen,
		       (unsigned)db_server_port(service->server, endpoint->number));
}

void service_log_listening(const struct service *service, const struct db_modbus_config *before,
                           const struct db_modbus_config *modbus)
{
	for (size_t i = 0; i < db_modbus_endpoint_count(modbus); i++) {
		const struct db_endpoint_config endpoint = db_modbus_endpoint_at(modbus, i);
		struct db_endpoint_config old;

		if (!before || !db_modbus_endpoint_find(before, endpoint.number, &old) ||
		    strcmp(old.listen, endpoint.listen) != 0)
			log_endpoint(service, &endpoint);
	}
}
