/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The service's inside and what all of its parts use. Internal to src/service; network thread.
 */
#ifndef DRIVEBRIDGE_SERVICE_STATE_H
#define DRIVEBRIDGE_SERVICE_STATE_H

#include "drivebridge/control_socket.h"
#include "drivebridge/log.h"
#include "drivebridge/registers.h"
#include "drivebridge/server.h"
#include "drivebridge/trace_keeper.h"
#include "service/plant.h"

#include <systemd/sd-event.h>

struct configuration;
struct must_stand;
struct reload;
struct status;

struct service {
	struct db_log_source log; /* the network side's */
	const char *path;         /* the configuration's */
	sd_event *loop;
	sd_event_source *term;
	sd_event_source *deadline; /* of the most impatient client */
	db_time armed;
	sd_event_source *pulse; /* feeds systemd's watchdog; null: there is none */
	db_time watchdog;       /* systemd's patience */
	struct plant *plant;
	uint16_t last_number;
	struct db_registers *registers;
	struct db_server *server;
	struct db_control_socket *control;
	struct reload *reload; /* under way; null */
	bool reload_again;     /* asked for meanwhile */
	char *reload_errors;   /* of the one under way, a line each; null: none so far */
	struct db_trace_keeper *traces;
	sd_event_source *keeping;            /* when one of them is due */
	uint32_t last_bus;                   /* number given last */
	struct configuration *configuration; /* what its files say now */
	struct must_stand *must_stand;       /* which drives must, over a restart */
	struct status *status;               /* what systemd shows; null: nobody listens */
	int lock;                            /* of the configuration, see alone.h; -1: none */
};

/* The loop's time: of when this turn of it began. */
db_time service_now(const struct service *service);

/* The network side speaking of a bus. */
struct db_log_source service_log_of(const struct service *service,
                                    const struct db_bus_config *bus_config);

/* Has the completions of a new bus fetched. 0 or a negative errno. */
int service_watch_bus(struct service *service, struct plant_bus *bus);

/* Fetches what the bus has ended. */
void service_collect(struct plant_bus *bus);

/* Where clients are waited for. */
void service_log_listening(const struct service *service, const struct db_modbus_config *modbus);

/* Leaves descriptors to the buses of the plant and to reloads, whatever clients take. */
void service_keep_descriptors(struct service *service);

#endif
