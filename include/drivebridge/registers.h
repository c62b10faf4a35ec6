/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The register view: what Modbus clients see and what their writes mean. It is the server's backend
 * and owns the commander of each drive. Network thread only; allocates only in db_registers_new().
 */
#ifndef DRIVEBRIDGE_REGISTERS_H
#define DRIVEBRIDGE_REGISTERS_H

#include "drivebridge/axis.h"
#include "drivebridge/bus.h"
#include "drivebridge/command.h"
#include "drivebridge/config.h"
#include "drivebridge/server.h"

struct db_registers;

struct db_registers_ops {
	db_time (*now)(void *context);
	uint64_t (*wall_us)(void *context); /* since 1970-01-01 UTC */
	/* Hands a request to a bus (index in the configuration). False when its queue is full. */
	bool (*submit)(void *context, size_t bus, const struct db_request *request);
	/* Answers a postponed write; see db_server_answer(). */
	void (*answer)(void *context, struct db_write_token token, uint8_t exception);
	void (*bus_stats)(void *context, size_t bus, struct db_bus_stats *stats);
	void (*server_stats)(void *context, struct db_server_stats *stats);
	/* The clients connected longest, at most `max`; how many. Null: clients are not shown. */
	size_t (*server_clients)(void *context, struct db_server_client *clients, size_t max);
	/* Something was refused to a client for who it is. May be null. */
	void (*refused)(void *context, const struct db_client *client, enum db_refusal kind);
	/* A client came or went. May be null. */
	void (*client)(void *context, const struct db_client *client, bool connected);
	/* The watchdog stops a drive (index in the configuration). `last` had fed it last, and may
	 * have gone since; its id is 0 when nobody had. May be null. */
	void (*tripped)(void *context, size_t drive, const struct db_client *last);
};

/*
 * axes[i] belongs to config->drives[i]. Everything handed in must outlive the registers. A request's
 * `axis` is the drive's place among the drives of its bus. 0 or -ENOMEM.
 */
int db_registers_new(const struct db_config *config, struct db_axis *const *axes,
                     const struct db_registers_ops *ops, void *context,
                     struct db_registers **registers);
void db_registers_free(struct db_registers *registers);

/* For db_server_new(); its context is the struct db_registers. */
extern const struct db_backend db_registers_backend;

/* A bus ended a request; finds the drive by its ticket. */
void db_registers_complete(struct db_registers *registers, const struct db_completion *completion,
                           db_time now);

/* When db_registers_expire() is due: the first waiting writer's time is up. DB_TIME_NEVER. */
db_time db_registers_next_deadline(const struct db_registers *registers);
void db_registers_expire(struct db_registers *registers, db_time now);

#endif
