/* SPDX-License-Identifier: Apache-2.0 */
/* The service's inside, shared by service.c and reload.c. Internal to src/service. */
#ifndef DRIVEBRIDGE_SERVICE_STATE_H
#define DRIVEBRIDGE_SERVICE_STATE_H

#include "drivebridge/log.h"
#include "drivebridge/registers.h"
#include "drivebridge/server.h"
#include "service/plant.h"

#include <systemd/sd-event.h>

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
	struct reload *reload; /* under way; null */
	bool reload_again;     /* asked for meanwhile */
	struct status *status; /* what systemd is told; null: nobody listens */
	int lock;              /* of the configuration, see alone.h; -1: none */
};

/* service.c */
db_time service_now(const struct service *service);
/* Has the completions of a new bus fetched. 0 or a negative errno. */
int service_watch(struct service *service, struct plant_bus *bus);
/* Fetches what the bus has ended. */
void service_collect(struct plant_bus *bus);
/* Where clients are waited for. */
void service_log_listening(const struct service *service, const struct db_modbus_config *modbus);
/* Leaves descriptors to the buses of the plant and to reloads, whatever clients take. */
void service_keep_descriptors(struct service *service);

/* reload.c */
/* SIGHUP: begins a reload, or remembers that another one is wanted. */
void reload_ask(struct service *service);
/* Goes on with the one under way as far as it can. Called in every turn of the loop. */
void reload_step(struct service *service);
/* The service ends, its buses have ended: frees what the one under way has prepared. */
void reload_abandon(struct service *service);

#endif
