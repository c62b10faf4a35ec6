/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What drivebridged tells: its drives and their registers, streams of values and of events, the figures of its buses.
 * Connects by itself, again and again; when the drives change, it is found again. One thread; never waits.
 */
#ifndef DRIVEBRIDGE_MQTT_PLANT_H
#define DRIVEBRIDGE_MQTT_PLANT_H

#include "drivebridge/time.h"
#include "mqtt/config.h"

#include <jansson.h>
#include <poll.h>

struct db_mqtt_plant;

/* All objects stay the plant's. */
struct db_mqtt_plant_ops {
	/* The service is there: the answer of Describe, with the drives that are to be published only, and their
	 * registers by drive, those that are published. */
	void (*found)(void *context, const json_t *description, const json_t *registers);
	void (*lost)(void *context);
	/* A sample of the interface's type Sample; when it was sent. */
	void (*sample)(void *context, const json_t *sample, int64_t us);
	/* So many samples were left out because this program read too slowly. */
	void (*skipped)(void *context, int64_t count);
	void (*event)(void *context, json_t *event);
	/* By bus. */
	void (*figures)(void *context, json_t *buses);
};

/* `config` must outlive it. NULL without memory; freed with db_mqtt_plant_free(), NULL is allowed. */
struct db_mqtt_plant *db_mqtt_plant_new(const struct db_mqtt_config *config,
                                        const struct db_mqtt_plant_ops *ops, void *context);
void db_mqtt_plant_free(struct db_mqtt_plant *plant);

#define DB_MQTT_PLANT_FDS 3

/* For poll(): places without a connection have fd -1. */
void db_mqtt_plant_watch(const struct db_mqtt_plant *plant, struct pollfd fds[DB_MQTT_PLANT_FDS]);

/* When db_mqtt_plant_handle() is to be called without anything being ready. */
db_time db_mqtt_plant_due(const struct db_mqtt_plant *plant);

/* Does what is to be done. `us`: microseconds since 1970-01-01 UTC. */
void db_mqtt_plant_handle(struct db_mqtt_plant *plant, db_time now, int64_t us);

#endif
