/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The service's alarms as conditions: one for each cause of a drive, of a bus and of the
 * configuration that there has been. A condition has the state of the latest alarm about it.
 * Independent of the OPC UA library.
 *
 * No I/O, no clock; allocates.
 */
#ifndef DRIVEBRIDGE_OPCUA_ALARMS_H
#define DRIVEBRIDGE_OPCUA_ALARMS_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The begin of the ids of their nodes, and the folder with them. */
#define DB_OPCUA_ALARMS "/Alarms"

#define DB_OPCUA_EVENT_ID_SIZE 24
#define DB_OPCUA_COMMENT_MAX 161

struct db_opcua_alarm {
	char id[128];      /* "/Alarms.drive.feeder.no_answer" */
	const char *cause; /* its last part */
	char kind[16];     /* drive, bus, configuration */
	char name[64];     /* of the drive or bus, "" for the configuration */
	char detail[64];   /* such as the name of the fault, or what the system says */
	char text[200];    /* what is wrong, in words: its name, cause and detail */
	unsigned severity; /* as of events, from 1 to 1000 ... */
	unsigned severity_before;
	int64_t number; /* the service's id of the latest alarm */
	int64_t change; /* the service's number of its latest change ... */
	int64_t came;   /* ... and of that with which it came last */
	bool present;
	bool acknowledged;
	/* Microseconds since 1970-01-01 UTC: when it came or went, was acknowledged, when its
	 * severity changed, and when the latest change was received. */
	int64_t active_us;
	int64_t acknowledged_us;
	int64_t severity_us;
	int64_t received_us;
	char by[128];                       /* who acknowledged it, "": nobody */
	char comment[DB_OPCUA_COMMENT_MAX]; /* what was said then over OPC UA */
	bool listed;                        /* part of the list that is being received */
	struct db_opcua_alarm *next;
};

/* Empty when all is 0, except the salt. */
struct db_opcua_alarms {
	struct db_opcua_alarm *list; /* in the order in which they came first */
	uint8_t salt[8];             /* other numbers in each run: ids of events differ over runs */
	bool complete;               /* the list was received to its end */
};

/* A condition has changed. */
typedef void db_opcua_alarm_fn(void *context, struct db_opcua_alarm *alarm);

/* Takes an answer to the service's method Alarms, and tells what has changed. The answer is one of
 * a list that begins with db_opcua_alarms_begin() and goes on with changes; what the list does not
 * have, the service has forgotten. `us`: now, microseconds since 1970-01-01 UTC. */
void db_opcua_alarms_begin(struct db_opcua_alarms *alarms);
void db_opcua_alarms_take(struct db_opcua_alarms *alarms, const json_t *answer, int64_t us,
                          db_opcua_alarm_fn *changed, void *context);
void db_opcua_alarms_free(struct db_opcua_alarms *alarms);

/* True while somebody has to look at it: it is there, or not acknowledged. */
bool db_opcua_alarm_is_retained(const struct db_opcua_alarm *alarm);

/* The id of the event that told the present state: always the same for this state. */
void db_opcua_alarm_event_id(const struct db_opcua_alarms *alarms,
                             const struct db_opcua_alarm *alarm,
                             uint8_t id[DB_OPCUA_EVENT_ID_SIZE]);
/* True if this event told the alarm as it is now, since it came last. */
bool db_opcua_alarm_has_event(const struct db_opcua_alarms *alarms,
                              const struct db_opcua_alarm *alarm, const uint8_t *id, size_t size);

/* --- members of a condition's node ------------------------------------------------------------ */

enum db_opcua_member {
	DB_OPCUA_MEMBER_EVENT_ID,
	DB_OPCUA_MEMBER_EVENT_TYPE,
	DB_OPCUA_MEMBER_SOURCE_NODE,
	DB_OPCUA_MEMBER_SOURCE_NAME,
	DB_OPCUA_MEMBER_TIME,
	DB_OPCUA_MEMBER_RECEIVE_TIME,
	DB_OPCUA_MEMBER_MESSAGE,
	DB_OPCUA_MEMBER_SEVERITY,
	DB_OPCUA_MEMBER_CLASS_ID,
	DB_OPCUA_MEMBER_CLASS_NAME,
	DB_OPCUA_MEMBER_NAME,
	DB_OPCUA_MEMBER_BRANCH,
	DB_OPCUA_MEMBER_RETAIN,
	DB_OPCUA_MEMBER_USER,
	DB_OPCUA_MEMBER_INPUT,
	DB_OPCUA_MEMBER_SUPPRESSED,
	/* Variables from here on, with properties of their own. */
	DB_OPCUA_MEMBER_ENABLED,
	DB_OPCUA_MEMBER_QUALITY,
	DB_OPCUA_MEMBER_LAST_SEVERITY,
	DB_OPCUA_MEMBER_COMMENT,
	DB_OPCUA_MEMBER_ACKED,
	DB_OPCUA_MEMBER_ACTIVE,
	/* Properties of those. */
	DB_OPCUA_MEMBER_ENABLED_ID,
	DB_OPCUA_MEMBER_QUALITY_TIME,
	DB_OPCUA_MEMBER_LAST_SEVERITY_TIME,
	DB_OPCUA_MEMBER_COMMENT_TIME,
	DB_OPCUA_MEMBER_ACKED_ID,
	DB_OPCUA_MEMBER_ACKED_TIME,
	DB_OPCUA_MEMBER_ACTIVE_ID,
	DB_OPCUA_MEMBER_ACTIVE_TIME,
	DB_OPCUA_MEMBERS
};

struct db_opcua_member_row {
	const char *path;           /* "AckedState.Id" */
	const char *name;           /* its last part */
	enum db_opcua_member above; /* DB_OPCUA_MEMBERS: the condition itself */
};

extern const struct db_opcua_member_row db_opcua_members[DB_OPCUA_MEMBERS];

/* The condition of this id, and DB_OPCUA_MEMBERS; or the one that an id's node is a member of. The
 * text needs no terminating zero. NULL: there is none. */
struct db_opcua_alarm *db_opcua_alarms_find(const struct db_opcua_alarms *alarms, const char *id,
                                            size_t length, enum db_opcua_member *member);

#endif
