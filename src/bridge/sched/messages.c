/* SPDX-License-Identifier: Apache-2.0 */
/* What the bus itself sends, whatever its drives do (struct db_bus_message). */
#include "sched/sched_private.h"

void messages_begin(struct db_engine *engine, db_time now)
{
	engine->next_message_at = DB_TIME_NEVER;
	for (size_t i = 0; i < engine->driver->message_count; i++) {
		db_time period = engine->driver->messages[i].period(engine->bus);

		engine->message_at[i] = period > 0 ? now : DB_TIME_NEVER;
		engine->messages_sent[i] = 0;
		engine->next_message_at = db_time_min(engine->next_message_at,
		                                      engine->message_at[i]);
	}
}

bool messages_send(struct db_engine *engine, db_time now)
{
	uint8_t request[DB_SHORT_REQUEST];
	struct db_exchange exchange = { .request = request, .request_size = sizeof(request) };
	const struct db_bus_message *message;
	db_time period;
	size_t i = 0;

	while (engine->message_at[i] > now)
		i++;
	message = &engine->driver->messages[i];
	period = message->period(engine->bus);
	message->write(engine->bus, engine->messages_sent[i]++, &exchange);
	if (period == DB_TIME_NEVER)
		engine->message_at[i] = DB_TIME_NEVER;
	else if (engine->message_at[i] + period > now)
		engine->message_at[i] += period;
	else /* late by more than a period: what was missed is not made up for */
		engine->message_at[i] = now + period;
	engine->next_message_at = DB_TIME_NEVER;
	for (i = 0; i < engine->driver->message_count; i++)
		engine->next_message_at = db_time_min(engine->next_message_at,
		                                      engine->message_at[i]);
	exchange_count_unanswered(engine, &exchange, !exchange_overlaps(engine), now);
	engine->busy += exchange_wire_time(engine, &exchange);
	(void)engine_send(engine, request, exchange.request_length, DB_TRACE_BROADCAST);
	return true;
}
