/* Steps of one law over the first rows of its vectors, each between two calls of eaid_mark: what lies between is counted. */
#include <stdio.h>

#include "eaid_control.h"
#include "vectors.h"
#ifdef __AVR__
#include <avr/io.h>
#endif

#define JOIN3(a, b, c) a##b##c
#define JOIN(a, b, c) JOIN3(a, b, c)
#define ROWS_OF JOIN(eaid_, LAW, _vectors)

STATE eaid_kept;
volatile eaid_real eaid_sink;

#ifdef __AVR__
static unsigned long eaid_ticks[2];
static unsigned int eaid_at;
static void eaid_mark(void)
{
    const unsigned int now = TCNT1;
    eaid_ticks[eaid_at++ & 1U] = now;
}
#else
__attribute__((noinline)) void eaid_mark(void)
{
    __asm__ volatile("");
}
#endif

int main(void)
{
    unsigned long k;
    unsigned long total = 0UL;
    unsigned long most = 0UL;
#ifdef __AVR__
    TCCR1B = (1 << CS11); /* eight cycles a tick */
#endif
    (void)JOIN(eaid_, LAW, _init)(&JOIN(eaid_, LAW, ), &eaid_kept, eaid_dt_s);
    for (k = 0UL; k < ROWS; k++)
    {
        const eaid_vector *v = &ROWS_OF[k];
        eaid_mark();
#ifdef PLANT
        eaid_sink = eaid_plant_step(&eaid_plant, &eaid_kept, v->reference);
#else
        eaid_sink = JOIN(eaid_, LAW, _step)(&JOIN(eaid_, LAW, ), &eaid_kept, v->reference, v->rate, v->torque);
#endif
        eaid_mark();
#ifdef __AVR__
        {
            const unsigned long took = ((eaid_ticks[1] - eaid_ticks[0]) & 0xFFFFUL) * 8UL;
            total += took;
            most = took > most ? took : most;
        }
#endif
    }
#ifdef __AVR__
    printf("cycles %lu %lu\n", total / ROWS, most);
#else
    (void)total;
    (void)most;
#endif
    return 0;
}
