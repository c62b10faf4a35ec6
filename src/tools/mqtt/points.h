/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The metrics of a Sparkplug device, or of the node itself: their values as last published, and
 * what is written of them. Pure but for memory.
 */
#ifndef DRIVEBRIDGE_MQTT_POINTS_H
#define DRIVEBRIDGE_MQTT_POINTS_H

#include "mqtt/payload.h"

/*
 * The aliases of all metrics of a node. A name has the same one as long as this program runs, even
 * when its drive is taken out of the configuration and put back: data that wait for a broker keep
 * their meaning.
 */
struct db_mqtt_aliases {
	json_t *known; /* by owner and name: an object, the caller's */
	int64_t next;
};

enum db_mqtt_point_kind {
	DB_MQTT_VALUE,    /* a register that is published, or a value of the node */
	DB_MQTT_RESULT,   /* of a command */
	DB_MQTT_RUN,      /* a command that can be written: `what` is its name */
	DB_MQTT_ARGUMENT, /* of a command: `what` is the name of its register */
	DB_MQTT_MARK,     /* what else a command may have with it: `what` is its name there */
};

struct db_mqtt_point {
	enum db_mqtt_point_kind kind;
	const char *name;
	const char *what;
	int64_t alias; /* or DB_MQTT_NO_ALIAS */
	bool named;    /* it has no alias: its name stands for it in all messages */
	enum db_mqtt_type type;
	const char *first;  /* of a command: its argument whose value is written to it; "": none */
	char *texts;        /* memory of the three texts */
	bool writable;      /* of a value: its register may be written */
	json_t *properties; /* NULL: none */
	json_t *value;
	int64_t us; /* of the value, microseconds since 1970-01-01 UTC */
	bool changed;
};

struct db_mqtt_points {
	struct db_mqtt_aliases *aliases;
	char *owner;
	char *template;
	int64_t instance; /* alias of the metric that is the instance */
	struct db_mqtt_point *list;
	size_t count;
	enum db_mqtt_quality quality;
	bool rated; /* the quality has changed since it was written */
};

/* `owner`: a device, "" is the node. `template`: the definition that its values are an instance of;
 * "": they are metrics of their own. NULL without memory; freed with db_mqtt_points_free(), NULL is
 * allowed. Texts are copied. */
struct db_mqtt_points *db_mqtt_points_new(struct db_mqtt_aliases *aliases, const char *owner,
                                          const char *template);
void db_mqtt_points_free(struct db_mqtt_points *points);

/* Adds one with no value yet; takes its properties over, and copies its texts. One of the same name
 * is there already: does nothing. False without memory. */
bool db_mqtt_points_add(struct db_mqtt_points *points, const struct db_mqtt_point *point);

/* Takes the value over. A point that does not exist is left out. */
void db_mqtt_points_set(struct db_mqtt_points *points, const char *name, json_t *value, int64_t us);

/* The quality of all values; what it was is DB_MQTT_UNSAID before the first time. */
void db_mqtt_points_rate(struct db_mqtt_points *points, enum db_mqtt_quality quality);

/* True if something has changed since it was written. */
bool db_mqtt_points_have_news(const struct db_mqtt_points *points);

/* By the name, or with NULL by the alias. NULL: there is none. */
struct db_mqtt_point *db_mqtt_points_find(const struct db_mqtt_points *points, const char *name,
                                          int64_t alias);

/* Adds all of them with all that is to be known of them, or those that have changed. None has
 * changed after that. `us`: now. */
void db_mqtt_points_write_all(struct db_mqtt_points *points, struct db_mqtt_payload *payload,
                              int64_t us);
void db_mqtt_points_write_news(struct db_mqtt_points *points, struct db_mqtt_payload *payload);

/* Adds the definition of a template with the values of several devices. */
void db_mqtt_points_write_definition(const char *name, struct db_mqtt_points *const *points,
                                     size_t count, struct db_mqtt_payload *payload, int64_t us);

/* True if births of both say the same, but for values. */
bool db_mqtt_points_are_same(const struct db_mqtt_points *one, const struct db_mqtt_points *other);

#endif
